"""What all tests stand on."""

import os
import signal

# before NumPy is loaded: its linear algebra waits for its threads in busy loops, which costs ten times the work
# where each core has a process of the suite already
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

# a suite started in the background ignores Ctrl-C, and so would every process it starts to interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
