"""Shared functions of the reader scripts: output of numbers."""

import json
import struct


def bits(value):
    """Replaces floats by strings of their bits, which lose nothing."""
    if isinstance(value, float):
        return str(struct.unpack("<Q", struct.pack("<d", value))[0])
    if isinstance(value, list):
        return [bits(one) for one in value]
    if isinstance(value, dict):
        return {name: bits(one) for name, one in value.items()}
    return value


def weighed(numbers):
    """Sum of the numbers, each weighted by its position, counted from 1."""
    return sum(k * int(x) for k, x in enumerate(numbers, 1))


def print_json(value):
    """Prints a value as JSON; floats become strings of their bits."""
    print(json.dumps(bits(value)))
