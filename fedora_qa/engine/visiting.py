"""In which order windows are visited when nobody knows how many will be: spread evenly, however early it ends."""


def visiting_order(windows: int) -> tuple[int, ...]:
    """Return the places 0 to ``windows`` - 1, the first and the last first, then always between those visited before.

    The places follow the sequence of van der Corput (1935): 1/2, 1/4, 3/4, 1/8, 5/8, ... of the way. After any number
    of them the longest gap is at most twice that of as many places spread evenly, but for rounding.
    """
    order = dict.fromkeys(place for place in (0, windows - 1) if 0 <= place < windows)
    number = 1
    while len(order) < windows:
        order.setdefault(round(_radical_inverse(number) * (windows - 1)))
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
