"""What the columns of real loggers are taken for: time, gyros with axis and unit, thermometers, and what is left alone.

Headers are those that the named programs write. Values are simulated: gyros at rest with MEMS noise, gravity on z.
"""

import numpy as np
import pytest

from vgyro.storage.logs.names import plain_unit
from vgyro.storage.logs.roles import roles_of
from vgyro.storage.logs.table import LogColumn
from vgyro.storage.logs.text.header import named

ROWS = 2000
NOISE = {"deg/s": 0.06, "rad/s": 0.001, "mdps": 60.0, "deg/h": 200.0, None: 8.0}


def values_of(code: str, unit: str | None, rng: np.random.Generator) -> np.ndarray:
    """A column of a kind: see HEADERS."""
    rows = np.arange(ROWS)
    made = {
        "t": 12.5 + rows / 100,
        "u": 1_700_000_000_000 + 10 * rows,
        "n": rows + 7,
        "T": np.round(25 + rows / ROWS + 0.02 * rng.standard_normal(ROWS), 2),
        "C": np.rint(-3000 + 20 * rng.standard_normal(ROWS)).astype(np.int64),
        "g": np.round(0.002 * rng.standard_normal(ROWS), 5),
        "G": np.round(1 + 0.002 * rng.standard_normal(ROWS), 5),
        "a": np.round(0.02 * rng.standard_normal(ROWS), 4),
        "A": np.round(9.81 + 0.02 * rng.standard_normal(ROWS), 4),
        "r": np.rint(16384 + 40 * rng.standard_normal(ROWS)).astype(np.int64),
        "m": np.round(22 + 0.4 * rng.standard_normal(ROWS), 2),
        "P": np.round(101_325 + 2 * rng.standard_normal(ROWS), 1),
        "q": np.round(0.5 + 1e-4 * rng.standard_normal(ROWS), 6),
        "o": np.round(-12 + 0.05 * rng.standard_normal(ROWS), 3),
        "0": np.zeros(ROWS),
        "s": np.array(["IMU"] * ROWS, dtype=object),
        "i": rows % 3,
    }
    if code in made:
        return made[code]
    noise = 0.3 * NOISE[unit] + NOISE[unit] * rng.standard_normal(ROWS)
    return np.rint(noise).astype(np.int64) if unit is None else noise


HEADERS = [
    # program, header, codes of its columns, unit of the gyros (None: counts)
    # x y z: a gyro on that axis;  Z: a gyro without an axis of its own;  t: the time, u: another time, n: a counter;
    # T: °C, C: a temperature in counts;  g G a A r: accelerations in g, in m/s², in counts;  m P q o 0 s: magnetic
    # field, pressure, quaternion, angle, zeros, text;  i: id
    ("Arduino MPU6050", "t,gx,gy,gz", "txyz", "deg/s"),
    ("Arduino MPU6050, counts", "ax,ay,az,gx,gy,gz", "rrrxyz", None),
    ("Arduino MPU6050, t", "millis,ax,ay,az,gx,gy,gz,temp", "taaAxyzT", "deg/s"),
    ("Arduino JohnChi", "AcX,AcY,AcZ,Tmp,GyX,GyY,GyZ", "rrrCxyz", None),
    ("Arduino JohnChi, °C", "AcX,AcY,AcZ,Tmp,GyX,GyY,GyZ", "rrrTxyz", None),
    ("Arduino bits", "accel_x,accel_y,accel_z,temperature,gyro_x,gyro_y,gyro_z", "rrrTxyz", None),
    ("Adafruit", "Time (ms),Accel X,Accel Y,Accel Z,Gyro X,Gyro Y,Gyro Z,Temperature", "taaAxyzT", "rad/s"),
    ("Adafruit, units", "accel_x m/s^2,accel_y m/s^2,accel_z m/s^2,gyro_x rad/s,gyro_y rad/s,gyro_z rad/s,temp C",
     "aaAxyzT", "rad/s"),
    ("SparkFun OpenLog Artemis",
     "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz", "stggGxyzmmmT-", "deg/s"),
    ("SparkFun LSM9DS1", "A_x,A_y,A_z,G_x,G_y,G_z,M_x,M_y,M_z", "ggGxyzmmm", "deg/s"),
    ("LSM9DS1 counts", "time_ms,gx_raw,gy_raw,gz_raw,ax_raw,ay_raw,az_raw,mx_raw,my_raw,mz_raw", "txyzrrrrrr", None),
    ("x-io ximu3",
     "Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),"
     "Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)", "txyzggG", "deg/s"),
    ("x-io NGIMU",
     "Time (s),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),"
     "Accelerometer Z (g),Magnetometer X (uT),Magnetometer Y (uT),Magnetometer Z (uT),Barometer (hPa)",
     "txyzggGmmmP", "deg/s"),
    ("x-IMU",
     "Packet number,Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g)",
     "nxyzG", "deg/s"),
    ("Xsens MTM",
     "PacketCounter,SampleTimeFine,Acc_X,Acc_Y,Acc_Z,FreeAcc_E,FreeAcc_N,FreeAcc_U,Gyr_X,Gyr_Y,Gyr_Z,Mag_X,Mag_Y,Mag_Z,"
     "Roll,Pitch,Yaw", "ntaaAaaaxyzmmmooo", "deg/s"),
    ("Xsens MT Manager, matrix",
     "SampleTimeFine,Acc_X,Acc_Y,Acc_Z,Gyr_X (rad/s),Gyr_Y (rad/s),Gyr_Z (rad/s),Mat[1][1],Mat[2][1],Mat[3][1],"
     "Mat[1][2]", "taaAxyzqqqq", "rad/s"),
    ("Xsens increments",
     "PacketCounter,SampleTimeFine,dv[1],dv[2],dv[3],OriInc_q0,OriInc_q1,OriInc_q2,OriInc_q3,Gyr_X,Gyr_Y,Gyr_Z",
     "ntaaaqqqqxyz", "deg/s"),
    ("Movella DOT",
     "PacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Gyr_X,Gyr_Y,Gyr_Z,Status",
     "ntoooaaaxyz0", "deg/s"),
    ("Movella DOT, quaternion",
     "PacketCounter,SampleTimeFine,Quat_W,Quat_X,Quat_Y,Quat_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,Gyr_X,Gyr_Y,Gyr_Z",
     "ntqqqqaaaxyz", "deg/s"),
    ("EuRoC",
     "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
     "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]", "txyzaaA", "rad/s"),
    ("TUM VI",
     "#timestamp [ns],w.x [rad s^-1],w.y [rad s^-1],w.z [rad s^-1],a.x [m s^-2],a.y [m s^-2],a.z [m s^-2],T [C]",
     "txyzaaAT", "rad/s"),
    ("TUM RGB-D", "timestamp,ax,ay,az", "taaA", None),
    ("KITTI oxts, part", "timestamp,roll,pitch,yaw,ax,ay,az,wx,wy,wz", "toooaaAxyz", "rad/s"),
    ("PX4 ulog2csv sensor_combined",
     "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_timestamp_relative,"
     "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2],accelerometer_integral_dt,"
     "accelerometer_clipping,gyro_clipping,accel_calibration_count,gyro_calibration_count", "txyz00aaA00000", "rad/s"),
    ("PX4 vehicle_angular_velocity",
     "timestamp,timestamp_sample,xyz[0],xyz[1],xyz[2],xyz_derivative[0],xyz_derivative[1],xyz_derivative[2]",
     "utxyzaaa", "rad/s"),
    ("ROS topic, rosbags",
     "header.stamp,orientation.x,orientation.y,orientation.z,orientation.w,orientation_covariance[0],"
     "angular_velocity.x,angular_velocity.y,angular_velocity.z,angular_velocity_covariance[0],"
     "linear_acceleration.x,linear_acceleration.y,linear_acceleration.z,linear_acceleration_covariance[0]",
     "tqqqq0xyz0aaA0", "rad/s"),
    ("ROS rostopic echo -p",
     "%time,field.header.seq,field.header.stamp,field.header.frame_id,field.orientation.x,field.orientation_covariance0,"
     "field.angular_velocity.x,field.angular_velocity.y,field.angular_velocity.z,field.angular_velocity_covariance0,"
     "field.linear_acceleration.x,field.linear_acceleration.y,field.linear_acceleration.z",
     "untsq0xyz0aaA", "rad/s"),
    ("Betaflight blackbox",
     "loopIteration,time (us),axisP[0],axisP[1],rcCommand[0],gyroADC[0],gyroADC[1],gyroADC[2],accSmooth[0],"
     "accSmooth[1],accSmooth[2],motor[0]", "nt000xyzrrr0", None),
    ("Betaflight, raw", "time (us),gyroUnfilt[0],gyroUnfilt[1],gyroUnfilt[2],debug[0]", "txyz0", None),
    ("ArduPilot mavlogdump", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz",
     "t0xyzaaA00T0000", "rad/s"),
    ("Sensor Logger (Tszheichoi)", "time,seconds_elapsed,z,y,x", "tuzyx", "rad/s"),
    ("Sensor Logger, one file",
     "time,seconds_elapsed,rotationRateX(rad/s),rotationRateY(rad/s),rotationRateZ(rad/s),gravityX(G),gravityY(G),"
     "accelerationX(G)", "tuxyzggg", "rad/s"),
    ("SensorLog iOS",
     "loggingTime(txt),loggingSample(N),accelerometerTimestamp_sinceReboot(s),accelerometerAccelerationX(G),"
     "motionTimestamp_sinceReboot(s),motionYaw(rad),motionRotationRateX(rad/s),motionRotationRateY(rad/s),"
     "motionRotationRateZ(rad/s),motionUserAccelerationX(G)", "tnuguoxyzg", "rad/s"),
    ("phyphox",
     '"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)","Absolute (rad/s)"',
     "txyz-", "rad/s"),
    ("Physics Toolbox", "time,gFx,gFy,gFz,wx,wy,wz", "tggGxyz", "rad/s"),
    ("AndroSensor",
     "ACCELEROMETER X (m/s²),ACCELEROMETER Y (m/s²),ACCELEROMETER Z (m/s²),GYROSCOPE X (rad/s),GYROSCOPE Y (rad/s),"
     "GYROSCOPE Z (rad/s),Time since start in ms", "aaAxyzt", "rad/s"),
    ("MATLAB Mobile", "Timestamp,X,Y,Z", "txyz", "rad/s"),
    ("Shimmer",
     "Shimmer_1234_Timestamp_Unix_CAL,Shimmer_1234_Accel_LN_X_CAL,Shimmer_1234_Accel_LN_Y_CAL,"
     "Shimmer_1234_Gyro_X_CAL,Shimmer_1234_Gyro_Y_CAL,Shimmer_1234_Gyro_Z_CAL", "taaxyz", "deg/s"),
    ("OpenSignals", "nSeq,DI,ACC1,ACC2,ACC3,GYRO1,GYRO2,GYRO3", "n0rrrZZZ", None),
    ("OpenSignals riot", "nSeq,ACC_X,ACC_Y,ACC_Z,GYR_X,GYR_Y,GYR_Z,MAG_X,MAG_Y,MAG_Z,TEMP,IO,QUAT_W,EULER_X",
     "nrrrxyzmmmT0qo", "deg/s"),
    ("MetaBase (mbientlab)",
     "epoch (ms),time (00:00),elapsed (s),x-axis (deg/s),y-axis (deg/s),z-axis (deg/s)", "tuuxyz", "deg/s"),
    ("WitMotion",
     "time,DeviceName,AccX(g),AccY(g),AccZ(g),AsX(°/s),AsY(°/s),AsZ(°/s),AngleX(°),AngleY(°),AngleZ(°),Temperature(°C)",
     "tsggGxyzoooT", "deg/s"),
    ("VectorNav CSV", "GpsTow,GyroX,GyroY,GyroZ,AccelX,AccelY,AccelZ,MagX,MagY,MagZ,Temp,Pres",
     "txyzaaAmmmTP", "rad/s"),
    ("Pixhawk QGC", "Timestamp,xgyro,ygyro,zgyro,xacc,yacc,zacc,xmag,ymag,zmag", "txyzrrrrrr", None),
    ("array, omega", "t,omega_1,omega_2,omega_3,omega_4,omega_5", "tZZZZZ", "deg/s"),
    ("array of boards",
     "t,imu1_ax,imu1_ay,imu1_az,imu1_gx,imu1_gy,imu1_gz,imu2_ax,imu2_ay,imu2_az,imu2_gx,imu2_gy,imu2_gz",
     "taaAxyzaaAxyz", "deg/s"),
    ("array of sensors", "time,sensor0_z,sensor1_z,sensor2_z,sensor3_z", "tzzzz", "deg/s"),
    ("array with thermometers", "t_ms,g1,t1,g2,t2,g3,t3", "tZTZTZT", "deg/s"),
    ("array of names", "t,GyroA,GyroB,GyroC,TempA", "tZZZT", "deg/s"),
    ("units at the end", "t_s,gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g", "txyzggG", "deg/s"),
    ("mdps", "t [ms];gx [mdps];gy [mdps];gz [mdps];ax [mg]", "txyzg", "mdps"),
    ("ST Unico", "time[us],acc_x[mg],acc_y[mg],acc_z[mg],gyro_x[mdps],gyro_y[mdps],gyro_z[mdps]", "tgggxyz", "mdps"),
    ("fibre-optic", "t (s),rate (deg/h),temp (degC)", "tZT", "deg/h"),
    ("German", "Zeit (s);Drehrate x (°/s);Drehrate y (°/s);Drehrate z (°/s);Beschleunigung x (m/s²);Temperatur (°C)",
     "txyzaT", "deg/s"),
    ("German, no units", "Zeit;Drehrate_x;Drehrate_y;Drehrate_z;Beschleunigung_x;Beschleunigung_z;Temperatur",
     "txyzaAT", "deg/s"),
    ("German, angular velocity", "Zeitstempel;Winkelgeschwindigkeit X;Winkelgeschwindigkeit Y;Beschl. X",
     "txya", "deg/s"),
    ("French", "temps (s);gyro x (rad/s);gyro y (rad/s);gyro z (rad/s);accélération x (m/s²);température (°C)",
     "txyzaT", "rad/s"),
    ("French, no units", "temps;vitesse_angulaire_x;vitesse_angulaire_y;vitesse_angulaire_z;acceleration_x",
     "txyza", "rad/s"),
    ("Spanish", "tiempo;velocidad_angular_x;velocidad_angular_y;aceleracion_x;temperatura", "txyaT", "deg/s"),
    ("pqr", "time,p,q,r,ax,ay,az", "txyzaaA", "rad/s"),
    ("ids", "t,id,gx,gy,gz", "tixyz", "deg/s"),
    ("ids, one axis", "time_us,sensor,rate", "tiZ", "deg/s"),
    ("acc only", "time,acc_x,acc_y,acc_z", "taaA", None),
    ("linear accelerometer", "Time (s),Linear Acceleration x (m/s^2),Linear Acceleration y (m/s^2)", "taa", None),
    ("magnetometer only", "t,mag_x,mag_y,mag_z", "tmmm", None),
]  # fmt: skip


def looked_at(header: str, codes: str, unit: str | None):
    """The columns of a header with values of their kinds, and what they are taken for."""
    sign = ";" if ";" in header else ","
    cells = [cell.strip('"') for cell in header.lstrip("#%").split(sign)]
    names = named(cells, [""] * len(cells))
    assert len(names) == len(codes), header
    rng = np.random.default_rng(len(header))
    head = {name: values_of(code, unit, rng) for (name, _), code in zip(names, codes, strict=True)}
    columns = [
        LogColumn(name, "text" if code == "s" else "number", given)
        for (name, given), code in zip(names, codes, strict=True)
    ]
    return [name for name, _ in names], roles_of(columns, head)


@pytest.mark.parametrize(("header", "codes", "unit"), [pytest.param(*row[1:], id=row[0]) for row in HEADERS])
def test_headers_of_real_loggers(header, codes, unit):
    names, roles = looked_at(header, codes, unit)
    expected = {name: "z" if code == "Z" else code for name, code in zip(names, codes, strict=True) if code in "xyzZ"}
    assert {gyro.column: gyro.axis for gyro in roles.gyros} == expected
    assert {gyro.unit for gyro in roles.gyros} <= {unit}
    times = [name for name, code in zip(names, codes, strict=True) if code == "t"]
    assert roles.time == (times[0] if times else None)
    assert list(roles.temperatures) == [name for name, code in zip(names, codes, strict=True) if code == "T"]
    assert roles.id == next((name for name, code in zip(names, codes, strict=True) if code == "i"), None)
    used = {roles.time, roles.id, *expected, *roles.temperatures}
    assert set(roles.other) == set(names) - used


def plain(**values):
    return roles_of([LogColumn(name) for name in values], values)


def three(length: float, noise: float, seed: int = 4):
    rng = np.random.default_rng(seed)
    direction = np.array([0.36, 0.48, 0.8])
    return length * direction[:, None] + noise * rng.standard_normal((3, ROWS))


@pytest.mark.parametrize(("length", "noise", "gyros"), [
    (9.81, 0.02, 0), (9.5, 0.02, 3), (10.1, 0.02, 3), (1.0, 0.002, 0), (0.95, 0.002, 3), (1.05, 0.002, 3),
])  # fmt: skip
def test_three_columns_without_names_as_long_as_gravity_are_no_gyros(length, noise, gyros):
    a, b, c = three(length, noise)
    roles = plain(c1=np.arange(ROWS) / 100, c2=a, c3=b, c4=c)
    assert len(roles.gyros) == gyros
    assert roles.time == "c1"


@pytest.mark.parametrize(
    ("length", "gyros"), [(16384 * 1.04, 0), (16384 * 1.06, 3), (16384 * 0.96, 0), (2048, 0), (300, 3)]
)
def test_counts_without_names_as_long_as_gravity_are_no_gyros(length, gyros):
    a, b, c = np.rint(three(length, 20)).astype(np.int64)
    assert len(plain(c1=np.arange(ROWS) * 10, c2=a, c3=b, c4=c).gyros) == gyros


def test_of_six_columns_without_names_those_of_gravity_are_left():
    rng = np.random.default_rng(1)
    accelerations, rates = three(9.81, 0.02), 0.1 * rng.standard_normal((3, ROWS))
    columns = {f"c{place}": values for place, values in enumerate([*accelerations, *rates], start=1)}
    assert [gyro.column for gyro in plain(**columns).gyros] == ["c4", "c5", "c6"]


def test_constants_and_other_quantities_are_no_gyros():
    # The standard deviation of many 3.3 is not exactly 0.
    noise = np.random.default_rng(1).standard_normal(ROWS)
    roles = plain(t=np.arange(ROWS) / 100, c2=np.full(ROWS, 3.3), volts=noise, battery=3.7 + noise)
    assert not roles.gyros
    assert [gyro.column for gyro in plain(t=np.arange(ROWS) / 100, c2=noise, volts=noise).gyros] == ["c2"]


@pytest.mark.parametrize(("about", "gyros"), [
    ("Accelerometer", 0), ("linear_acceleration", 0), ("TotalAcceleration", 0), ("Magnetometer", 0), ("Gyroscope", 3),
    ("run3", 3), ("tmp", 3), ("sensor_accel", 0), ("sensor_gyro", 3),
])  # fmt: skip
def test_the_name_of_a_file_or_table_tells_where_columns_do_not(about, gyros):
    rng = np.random.default_rng(2)
    values = dict(zip("xyz", 0.05 * rng.standard_normal((3, ROWS)), strict=True))
    assert len(roles_of([LogColumn(name) for name in values], values, about).gyros) == gyros


def test_w_x_y_z_of_length_one_are_a_quaternion():
    w, x, y = three(1.0, 0.001)
    assert not plain(w=0.8 * w, x=0.8 * x, y=0.8 * y, z=0.6 * np.ones(ROWS)).gyros
    assert plain(wx=w, wy=x, wz=y).gyros


@pytest.mark.parametrize(
    "name", ["velocity_x", "vel_n", "sample_rate", "gyro_bias_x", "gyro_temp", "w_covariance", "x_g"]
)
def test_what_looks_like_a_gyro_and_is_none(name):
    rng = np.random.default_rng(3)
    roles = plain(t=np.arange(ROWS) / 100, gx=rng.standard_normal(ROWS), **{name: 20 + rng.standard_normal(ROWS)})
    assert [gyro.column for gyro in roles.gyros] == ["gx"]


def test_gyros_whose_unit_is_not_written_share_one_guess():
    rng = np.random.default_rng(5)
    noise = np.array([0.006, 0.012, 0.013])[:, None] * rng.standard_normal((3, ROWS))
    assert {gyro.unit for gyro in plain(**dict(zip(("gx", "gy", "gz"), noise, strict=True))).gyros} == {"deg/s"}
    # A gyro that gives only zeros is whole, but the others say that they are no counts.
    assert {gyro.unit for gyro in plain(gx=np.zeros(ROWS), gy=noise[1], gz=noise[2]).gyros} == {"deg/s"}


@pytest.mark.parametrize(("noise", "unit"), [(0.0075, "rad/s"), (0.0085, "deg/s")])
def test_the_noise_tells_the_unit(noise, unit):
    values = noise * np.random.default_rng(6).standard_normal(200_000)
    assert [gyro.unit for gyro in plain(gx=values).gyros] == [unit]


def test_coarse_and_held_readings_are_not_taken_for_rad_s():
    rng = np.random.default_rng(7)
    assert plain(gx=np.round(0.04 * rng.standard_normal(ROWS), 1)).gyros[0].unit == "deg/s"
    assert plain(gx=np.repeat(0.06 * rng.standard_normal(ROWS // 4), 4)).gyros[0].unit == "deg/s"


@pytest.mark.parametrize(("written", "plain_form"), [
    ("rad s^-1", "rad/s"), ("rad/sec", "rad/s"), ("rad·s⁻¹", "rad/s"), ("RAD/S", "rad/s"), ("deg per second", "deg/s"),
    ("º/s", "°/s"), ("deg.s-1", "deg/s"), ("m s^-2", "m/s2"), ("m/s²", "m/s2"), ("m/s^2", "m/s2"),
    ("rad s^-2", "rad/s2"), ("deg C", "degc"),
])  # fmt: skip
def test_units_in_one_way_of_writing(written, plain_form):
    assert plain_unit(written) == plain_form
