"""Which instruction set the kernels use."""

cdef extern from *:
    """
    const char *vg_instruction_set(void);
    """
    const char *vg_instruction_set()


def instruction_set() -> str:
    """The variant of the kernels that runs here."""
    return vg_instruction_set().decode()
