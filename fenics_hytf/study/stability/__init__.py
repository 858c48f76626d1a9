# SPDX-License-Identifier: MIT
"""Stability maps: where the method converges, where it drifts, where it blows up.

Lapses (length × damping × moduli left × ηT, and length × highest frequency), cut cells (fill
fraction × frequency, with the ghost term and without), and contrast × damping. What a scene refuses
is computed all the same, so that a map shows where the edge lies beyond the rule.
"""
