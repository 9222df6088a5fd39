"""What the scripts that read recordings have in common: how they say numbers."""

import json
import struct


def bits(value):
    """Numbers with a fraction as texts of their bits: nothing is lost on the way."""
    if isinstance(value, float):
        return str(struct.unpack("<Q", struct.pack("<d", value))[0])
    if isinstance(value, list):
        return [bits(one) for one in value]
    if isinstance(value, dict):
        return {name: bits(one) for name, one in value.items()}
    return value


def weighed(numbers):
    """The sum of numbers, each by its place."""
    return sum(k * int(x) for k, x in enumerate(numbers, 1))


def tell(what):
    """Says it as JSON."""
    print(json.dumps(bits(what)))
