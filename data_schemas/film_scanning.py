"""What becomes of an exposed film: development, dirt, the scanner. Part of the section `film` of a scene."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from data_schemas.scene_fields import Count, Number, Section, Switch, quantity


class FilmEmulsion(Section):
    """Characteristic curve: density = fog + (density_max - fog) / (1 + (half_exposure / exposure)^gamma)."""

    fog: Number = quantity(0.1, "1", "density of what was not exposed", ge=0, le=3)
    density_max: Number = quantity(1.5, "1", "density of what was exposed without end", gt=0, le=6)
    half_exposure: Number = quantity(0.2, "1", "exposure that gives half of the range", gt=0, le=1e3)
    gamma: Number = quantity(1.5, "1", "steepness of the curve", ge=0.2, le=10)
    grain: Number = quantity(
        0.0, "1", "1 sigma of the density of a pixel at 300 dpi where the density is 1; goes with its root", ge=0, le=1
    )
    fog_gradient: Number = quantity(
        0.0, "1", "density by which the right edge of the paper is more fogged than the left", ge=-2, le=2
    )

    @model_validator(mode="after")
    def _light_shows(self) -> Self:
        if self.density_max <= self.fog + abs(self.fog_gradient):
            raise ValueError("density_max must be above the fog, its gradient included")
        return self


class FilmDirt(Section):
    """What chance and people leave on a film."""

    dust: Number = quantity(0.0, "dm-2", "specks and pinholes on each square decimetre", ge=0, le=1e4)
    scratches: Number = quantity(0.0, "m-1", "scratches along each metre of film", ge=0, le=1e3)
    handwriting: Count = quantity(0, "1", "notes written on the film", ge=0, le=1000)
    torn_end: Number = quantity(0.0, "mm", "length of film that is torn off at its end", ge=0, le=1e6)


class FilmScanner(Section):
    """The image that is made of the film."""

    dpi: Number = quantity(300.0, "inch-1", "pixels to the inch", ge=50, le=4800)
    bits: Literal[8, 16] = quantity(8, "1", "bits of a pixel")
    polarity: Literal["negative", "positive"] = quantity(
        "negative", "", "'negative': dark lines on light paper, as developed; 'positive': light lines on dark, a print"
    )
    upside_down: Switch = quantity(False, "", "whether the film lay in the scanner turned by half a turn")
    rotation: Number = quantity(
        0.0,
        "degrees",
        "turn of the whole paper in the scanner; positive: its end lies further to the right",
        ge=-5,
        le=5,
    )
    vignette: Number = quantity(
        0.0, "1", "part of the light that is lost at the image's left and right edge", ge=0, lt=1
    )
    blur: Number = quantity(0.0, "1", "1 sigma of the scanner's blur, px", ge=0, le=10)
