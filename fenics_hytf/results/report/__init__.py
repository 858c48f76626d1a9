# SPDX-License-Identifier: MIT
"""``report.html``, part by part: method, input, findings, computation."""
