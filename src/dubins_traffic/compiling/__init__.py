"""What compiles kernels: Numba changed to our ends, the process that compiles beside, and the library it makes."""
