# SPDX-License-Identifier: MIT
"""``python3 -m fenics_hytf.cli`` is ``hytf``."""

from fenics_hytf.cli.app import main

if __name__ == "__main__":
    main()
