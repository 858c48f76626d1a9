# SPDX-License-Identifier: MIT
"""The command line ``hytf``: arguments, progress, messages and exit codes."""

from fenics_hytf.cli.app import main

__all__ = ["main"]
