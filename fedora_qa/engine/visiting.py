"""In which order windows are visited when nobody knows how many will be: spread evenly, however early it ends."""

from fedora_qa.engine.plan import FEWEST_WINDOWS


def visiting_order(windows: int, together: int = 1) -> tuple[int, ...]:
    """Return the places 0 to ``windows`` - 1 in the order in which they are visited, the first and the last first.

    Stretches of ``together`` neighbours follow each other as ``_spread`` says, since short windows cost less beside
    each other than apart. One window of each of the first ``FEWEST_WINDOWS`` stretches comes before all else.
    """
    stretches = -(-windows // together)
    order: dict[int, None] = {}
    for stretch in _spread(stretches)[:FEWEST_WINDOWS]:
        order[windows - 1 if 0 < stretch == stretches - 1 else stretch * together] = None
    for stretch in _spread(stretches):
        order |= dict.fromkeys(range(stretch * together, min((stretch + 1) * together, windows)))
    return tuple(order)


def _spread(count: int) -> tuple[int, ...]:
    """Return the numbers 0 to ``count`` - 1, the first and the last first, then always between those before them.

    They follow the sequence of van der Corput (1935): 1/2, 1/4, 3/4, 1/8, 5/8, ... of the way. After any number of them
    the longest gap is at most twice that of as many places spread evenly, but for rounding.
    """
    order = dict.fromkeys(place for place in (0, count - 1) if 0 <= place < count)
    number = 1
    while len(order) < count:
        order.setdefault(round(_radical_inverse(number) * (count - 1)))
        number += 1
    return tuple(order)


def _radical_inverse(number: int) -> float:
    """Return the binary digits of a whole number mirrored at the point: 1, 10, 11 become 0.1, 0.01, 0.11."""
    inverse, digit = 0.0, 0.5
    while number:
        inverse += digit * (number & 1)
        number >>= 1
        digit /= 2
    return inverse
