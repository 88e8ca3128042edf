"""`python -m pipeline.cli`: the command line where no entry script was installed."""

import sys

from pipeline.cli.main import main

if __name__ == "__main__":
    sys.exit(main())
