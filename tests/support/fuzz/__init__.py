# SPDX-License-Identifier: MIT
"""Scenes, records and meshes by chance, sound ones and broken ones, and what must hold of all."""
