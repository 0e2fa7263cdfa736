"""Take one feature out of those of a statistic."""

from collections.abc import Iterable
from typing import TypeVar

from fedora_qa.features import Feature

FeatureType = TypeVar("FeatureType", bound=Feature)


def only_feature(features: Iterable[Feature], kind: type[FeatureType]) -> FeatureType:
    """Return the feature of a type that every statistic of a check has.

    Parameters
    ----------
    features
        Of one statistic.
    kind
        The type; of several features of it the first is returned.

    Returns
    -------
    FeatureType
        The feature.

    Raises
    ------
    StopIteration
        The statistic has no such feature: the check and its hypotheses contradict each other.
    """
    return next(feature for feature in features if isinstance(feature, kind))
