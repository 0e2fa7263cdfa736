"""Normal equations of all stretches together, with the nuisances of single stretches eliminated."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fedora_qa.estimators.fitting.normal_equations import BlockEquations, inverse_of

Float64 = NDArray[np.float64]


class SummedEquations:
    """Sums over B stretches for P parameters.

    Parameters
    ----------
    blocks
        The stretches.
    count
        P; the unknowns that follow in each stretch are its nuisances.
    nuisance_covariance
        (B, B) prior covariance of a nuisance between stretches; None where there are none.

    Attributes
    ----------
    normals, normal
        (B, P, P) of single stretches, nuisances at 0; (P, P) of all, nuisances eliminated.
    right, model_right, squares
        Of all, nuisances eliminated: (P,), (P,), a number.
    model_rights
        (B, P) of single stretches, nuisances at 0.
    """

    def __init__(self, blocks: Sequence[BlockEquations], count: int, nuisance_covariance: Float64 | None) -> None:
        self.normals = np.array([block.normal[:count, :count] for block in blocks])
        self.model_rights = np.array([block.model_right[:count] for block in blocks])
        self.normal: Float64 = self.normals.sum(axis=0)
        self.model_right: Float64 = self.model_rights.sum(axis=0)
        self._rights = np.array([block.right[:count] for block in blocks])
        self.right: Float64 = self._rights.sum(axis=0)
        self.squares = float(sum(block.squares for block in blocks))
        self._nuisances = None
        if nuisance_covariance is not None:
            self._nuisances = _Nuisances(blocks, count, nuisance_covariance)
            self.normal = self.normal - self._nuisances.normal
            self.right = self.right - self._nuisances.right
            self.model_right = self.model_right - self._nuisances.model_right
            self.squares -= self._nuisances.squares

    def scores(self, values: Float64) -> Float64:
        """Return (B, P) what single stretches have left on the right side beside ``values`` (P,)."""
        left: Float64 = self._rights - self.normals @ values
        return left if self._nuisances is None else left - self._nuisances.scores(values)


class _Nuisances:
    """Unknowns of single stretches, correlated between stretches by their prior, eliminated from the equations.

    Attributes
    ----------
    normal, right, model_right, squares
        What their elimination takes from the parameters' equations (Schur complement).
    """

    def __init__(self, blocks: Sequence[BlockEquations], count: int, covariance: Float64) -> None:
        segments, nuisances = len(blocks), len(blocks[0].right) - count
        own = np.kron(np.linalg.inv(covariance), np.eye(nuisances))
        for place, block in enumerate(blocks):
            here = slice(place * nuisances, (place + 1) * nuisances)
            own[here, here] += block.normal[count:, count:]
        self._inverse = inverse_of(own)
        self._mixed = np.array([block.normal[:count, count:] for block in blocks])
        self._joined = np.concatenate(tuple(self._mixed), axis=-1)
        self._right = np.concatenate([block.right[count:] for block in blocks])
        self._shape = (segments, nuisances)
        model_right = np.concatenate([block.model_right[count:] for block in blocks])
        self.normal = self._joined @ self._inverse @ self._joined.T
        self.right = self._joined @ self._inverse @ self._right
        self.model_right = self._joined @ self._inverse @ model_right
        self.squares = float(self._right @ self._inverse @ self._right)

    def scores(self, parameters: Float64) -> Float64:
        """Return (B, P) what the nuisances, fitted beside ``parameters``, take from each stretch's right sides."""
        fitted = (self._inverse @ (self._right - self._joined.T @ parameters)).reshape(self._shape)
        taken: Float64 = np.einsum("bpq,bq->bp", self._mixed, fitted)
        return taken
