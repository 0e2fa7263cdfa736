"""Visiting order of windows whose number is not known before: spread evenly, however early it ends."""

from fedora_qa.engine.plan import FEWEST_WINDOWS


def visiting_order(windows: int, together: int = 1) -> tuple[int, ...]:
    """Return the places 0 to ``windows`` - 1 in the order in which they are visited, the first and the last first.

    Groups of ``together`` neighbours follow each other in the order of ``_spread``, since neighbouring short windows
    share decoded rows. One window of each of the first ``FEWEST_WINDOWS`` groups comes before all others.
    """
    stretches = -(-windows // together)
    order: dict[int, None] = {}
    for stretch in _spread(stretches)[:FEWEST_WINDOWS]:
        # Of the last group its last window: the first windows visited shall span the whole sequence.
        order[windows - 1 if 0 < stretch == stretches - 1 else stretch * together] = None
    for stretch in _spread(stretches):
        order |= dict.fromkeys(range(stretch * together, min((stretch + 1) * together, windows)))
    return tuple(order)


def _spread(count: int) -> tuple[int, ...]:
    """Return the numbers 0 to ``count`` - 1: the first, the last, then always numbers between earlier ones.

    They follow the sequence of van der Corput (1935): 1/2, 1/4, 3/4, 1/8, 5/8, ... of the way. After any number of them
    the longest gap is at most twice that of as many places spread evenly, but for rounding.
    """
    order = dict.fromkeys(place for place in (0, count - 1) if 0 <= place < count)
    number = 1
    while len(order) < count:
        # After rounding a number may come again; its first place in the order holds.
        order.setdefault(round(_radical_inverse(number) * (count - 1)))
        number += 1
    return tuple(order)


def _radical_inverse(number: int) -> float:
    """Return the binary digits of a whole number mirrored at the point: 1, 10, 11 become 0.1, 0.01, 0.11."""
    inverse, digit = 0.0, 0.5
    # Radical inverse in base 2 (van der Corput, 1935): the sum of b_k 2^-(k+1) over the binary digits b_k.
    while number:
        inverse += digit * (number & 1)
        number >>= 1
        digit /= 2
    return inverse
