"""All that reaches into parts of numba that it does not document, a concern in each module.

`parts`: functions compiled for the kernels that call them.  `sealed`: kernels of the same bits in every
process.  `disk`: kernels kept on disk for many processes.  Each checks, when it is imported, that this version
of numba has what it relies on, and raises ImportError if not: `slipsweep.jit.form` then takes `plain`.
"""
