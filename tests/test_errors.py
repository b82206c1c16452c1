"""What a user reads when something is wrong."""

import pickle

import pytest

from vgyro.errors import ConfigError, DataError, EngineError, TooShort, UsageError, VgyroError


def test_a_message_says_where_what_and_what_to_do():
    assert str(DataError("no frame holds", "a.bin", "check the board")) == "a.bin: no frame holds. Check the board."
    assert str(DataError("no frame holds")) == "no frame holds."


def test_a_question_keeps_its_mark():
    assert str(UsageError("no command 'chek'; did you mean 'check'?")) == "no command 'chek'; did you mean 'check'?"


def test_exit_codes_tell_the_kinds_apart():
    codes = [kind.exit_code for kind in (VgyroError, UsageError, ConfigError, DataError, EngineError)]
    assert codes == [1, 2, 3, 4, 5]
    assert TooShort.exit_code == DataError.exit_code


@pytest.mark.parametrize("kind", [VgyroError, UsageError, ConfigError, DataError, TooShort, EngineError])
def test_errors_survive_pickling(kind):
    error = pickle.loads(pickle.dumps(kind("what", "where", "remedy")))
    assert (type(error), error.what, error.where, error.remedy) == (kind, "what", "where", "remedy")
