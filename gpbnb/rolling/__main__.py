"""``python -m gpbnb.rolling``: simulate the years of all gyros again, and write ``drift_rates.csv``."""

from gpbnb.rolling import experiment

if __name__ == "__main__":
    study = experiment.drift_rates(
        experiment.SURVEY_PERIODS, experiment.SURVEY_GYROS, experiment.survey_rng(), progress=True
    )
    experiment.SURVEY.write_text(experiment.write_survey(study), encoding="utf-8", newline="")
