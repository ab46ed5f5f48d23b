"""SI inside; these factors convert at the door: ``length_mm * MM`` is metres, ``length / MM`` is mm."""

MM = 1e-3
UM = 1e-6
KN = 1e3
MPA = 1e6
GPA = 1e9
MINUTE = 60.0
