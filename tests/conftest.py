"""What all tests stand on."""

import signal

# a suite started in the background ignores Ctrl-C, and so would every process it starts to interrupt
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
