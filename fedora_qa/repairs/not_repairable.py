"""The error that ends a repair."""

from fedora_qa.errors import FedoraError


class NotRepairableError(FedoraError):
    """The file cannot be repaired, or its copy would not be better; the message states the reason."""
