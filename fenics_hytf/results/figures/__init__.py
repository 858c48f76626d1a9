# SPDX-License-Identifier: MIT
"""Figures of a stored result, and of the curves of a scene; one module a kind of figure."""
