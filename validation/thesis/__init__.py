"""The thesis's experiments and figures, repeated with the library: ``python -m thesis --help``, with ``validation`` on
PYTHONPATH."""
