"""An error of a parameter from which flow is recomputed, as a feature."""

from dataclasses import dataclass

from fedora_qa.features import Feature


@dataclass(frozen=True, slots=True)
class FlowParameterFit(Feature):
    """An error of one parameter of the recomputed flow, fitted alone to all fields of one rate.

    Attributes
    ----------
    parameter, unit
        Cause and unit of the parameter's template.
    value, standard_error
        The error of the parameter, and its standard error, in that unit.
    removed_share
        Share of the rms deviation that the error explains, 0 to 1.
    components
        Of the error, of which ``value`` is the norm with the sign of the largest.
    smooth_share
        As ``removed_share``, of the pixels away from breaks of the flow; 0 where these were not fitted on their own.
    """

    parameter: str
    value: float
    unit: str
    standard_error: float
    removed_share: float
    components: tuple[float, ...] = ()
    smooth_share: float = 0.0
