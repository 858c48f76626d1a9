# SPDX-License-Identifier: MIT
"""A small scene with something of everything that lapses hand over."""

SCENE = """
title = "A section"
[mesh]
box = { size = [8.0, 6.0], cells = [4, 3], cell = "quadrilateral" }
regions = [ { soil = "sand", below = 4.0 }, { soil = "fill" } ]
[soil.sand]
density = 1900.0
shear_wave_velocity = 220.0
poisson = 0.3
curves = { model = "darendeli", plasticity_index = 0, mean_stress = 80e3 }
[soil.fill]
density = 1800.0
shear_wave_velocity = 160.0
poisson = 0.3
damping = 0.03
[[motion]]
direction = "x"
synthetic = { n = 128, dt = 0.04 }
pga = 0.2
[boundary]
left = "tied"
right = "tied"
[lapses]
count = 4
[effects]
equivalent_linear = { tolerance = 1e-2 }
convection = true
geometric_stiffness = true
[solver]
sweep = "reduced"
[output]
receivers = { top = [4.0, 6.0], rider = { point = [3.0, 5.0] } }
"""
