"""The withheld-effect check: capture sets from an independent generator, a runner without keys, and a scorer.

The generator writes capture sets from the physics of the capture-set format's baseline and catalogue, in NumPy and
SciPy float64; it shares no code, no random numbers and no tables with the library. The keys lie beside the sets, never
in them. `python -m gap_check --help` gets going.
"""
