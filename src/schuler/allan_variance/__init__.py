"""Allan, Hadamard and total deviation of a static record, and the noise terms fitted to them."""

from __future__ import annotations

from schuler.allan_variance.density import Densities, Density, densities
from schuler.allan_variance.deviation import AllanSums, allan, allan_deviation
from schuler.allan_variance.export import export_noise, noise_text
from schuler.allan_variance.fit import fit_noise
from schuler.allan_variance.noise_fit import ChannelFit, NoiseFit, NoiseTerm
from schuler.allan_variance.result import Allan

__all__ = [
    "Allan",
    "AllanSums",
    "ChannelFit",
    "Densities",
    "Density",
    "NoiseFit",
    "NoiseTerm",
    "allan",
    "allan_deviation",
    "densities",
    "export_noise",
    "fit_noise",
    "noise_text",
]
