"""`python -m slipsweep`."""

import sys

from slipsweep.cli import main

sys.exit(main())
