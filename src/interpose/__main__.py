"""`python -m interpose` is the command `interpose`."""

import sys

from interpose.cli import main

sys.exit(main())
