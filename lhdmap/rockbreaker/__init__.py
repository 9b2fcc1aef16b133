"""Rockbreaker: collision-free, flow-limited trajectories of a 4-DoF hydraulic arm over a grizzly.

Frame: origin on the swing axis, x along the grizzly's middle, y left, z up (the paper's X1 Y1 Z1); metres, radians; litres a
minute and degrees only where names say so.

Source of all of it: Tremblay, Arsenault, Zeinali (2019), `rockbreaker_trajectories`, with its errata.
"""
