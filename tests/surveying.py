"""The errors of a model for one record in several precisions, as pairs."""

from gpbnb import FloatFormat, survey_records


def survey(model, z, tolerance, precisions, base=2, rounding="nearest", form=None, basis="emulation", **range_):
    """Each precision, and the largest error or bound / tolerance."""
    formats = [FloatFormat(base, each, rounding, **range_) for each in precisions]
    found = survey_records(model, [z], tolerance, formats, form=form, basis=basis)
    return tuple(zip(precisions, found.ratios[0].tolist(), strict=True))
