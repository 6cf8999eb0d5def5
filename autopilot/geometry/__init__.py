"""Compiled maths on R3, SO(3) and S2, and the frame conventions. A leaf: it imports nothing of Plumbline."""
