"""Expected title and axis labels of figures.

Each key is a folder and a test; each value is the title, the horizontal and the vertical axis label.
"""

TITLE_AND_AXES = {
    "budget test_budget_curve": ("", "number of equal sources $N$", "error of each (mas/yr)"),
    "budget test_distribution": ("", "total error (mas/yr)", "density (yr/mas)"),
    "budget test_shares": ("", "share of the square of the total (%)", ""),
    "geometry test_deroll_of_a_roll[derived]": (
        r"equation (5): circles $\hat\alpha_3$, squares $\hat\alpha_2$",
        "roll (turns)",
        "angle (arcsec)",
    ),
    "geometry test_deroll_of_a_roll[printed]": (
        r"equation (8): circles $\hat\alpha_3$, squares $\hat\alpha_2$",
        "roll (turns)",
        "angle (arcsec)",
    ),
    "geometry test_first_rolls": ("", "time (minutes)", r"measured $\varphi_2$ (arcsec)"),
    "geometry test_losses": ("", "angle (arcsec)", r"error of $\varphi$ after a year (mas)"),
    "geometry test_year_errors[second]": ("", "time (years)", r"error of $\varphi_2$ (mas)"),
    "geometry test_year_errors[third]": ("", "time (years)", r"error of $\varphi_3$ (mas)"),
    "integration test_accuracy": ("", r"$\mu=\omega_{bw}/f_c$ (rad)", "error (units in the last place)"),
    "integration test_approximations": ("", r"$\mu=\omega_{bw}/f_c$ (rad)", "relative error"),
    "integration test_best_rates": ("solid: rounded; dotted: chopped", "wordlength $t$ (bits)", "best rate $f_c$ (Hz)"),
    "integration test_build_up": (
        r"$\mu = 0.2$; green: theory; dotted: random walk only",
        "cycles $n$",
        r"rms error ($\sigma_xT$)",
    ),
    "integration test_deviations": ("", r"$\mu=\omega_{bw}/f_c$ (rad)", "deviation\n(standard errors)"),
    "integration test_errors_over_rate": (
        "discretization and rounding error",
        "iteration rate $f_c$ (Hz)",
        "rms error\n(unit of $x_1$ $\\times$ s)",
    ),
    "integration test_names_that_would_collide_move_apart": (
        "discretization and rounding error",
        "iteration rate $f_c$ (Hz)",
        "rms error\n(unit of $x_1$ $\\times$ s)",
    ),
    "integration test_needed_bits": ("solid: rounded; dotted: chopped", "iteration rate $f_c$ (Hz)", "bits needed"),
    "integration test_powers": ("", r"$\mu=\omega_{bw}/f_c$ (rad)", "power in (35)"),
    "integration test_random_walk": ("", r"$\mu=\omega_{bw}/f_c$ (rad)", "random walk per cycle\n($\\sigma_x T$)"),
    "integration test_rules_first_order": (
        "first-order input",
        r"$\mu=\omega_{bw}/f_c$ (rad)",
        "random walk relative\nto trapezoidal",
    ),
    "integration test_rules_resonant": (
        "resonant input, damping 0.05",
        "iteration rate over natural frequency, $f_c/f_0$",
        "random walk\n($\\sigma_x/\\sqrt{f_0}$)",
    ),
    "integration test_totals": (
        "total error; stars mark the best rate",
        "iteration rate $f_c$ (Hz)",
        "total error, rms\n(unit of $x_1$ $\\times$ s)",
    ),
    "kalman test_contraction": ("", "step $k$", "error of rate (mas/yr)"),
    "kalman test_years_with_limits": ("", "step $k$", "relative error of the gain"),
    "kalman test_digits_needed[others]": (
        "",
        r"decimal digits, $1-\log_{10} 2\beta$",
        "largest error in a year (mas, mas/yr)",
    ),
    "kalman test_digits_needed[front]": (
        "",
        r"decimal digits, $1-\log_{10} 2\beta$",
        "largest error in a year (mas, mas/yr)",
    ),
    "kalman test_guarantee": ("", "step", "rounding error of the speed, m/s"),
    "kalman test_shares": ("", "decimal digits", "largest error in a year (mas, mas/yr)"),
    "kalman test_years[covariance]": ("", "step $k$", "relative error of the covariance"),
    "kalman test_years[drift]": ("", "step $k$", "error of the drift angle (mas)"),
    "kalman test_years[gain]": ("", "step $k$", "relative error of the gain"),
    "kalman test_years[rate]": ("", "step $k$", "error of the drift rate (mas/yr)"),
    "rounding test_cancellation": (
        "",
        r"cancellation $\|M_1\|\,\|M_2\| \,/\, \|M_1 M_2\|$",
        r"error / $\|M_1\|\,\|M_2\|$",
    ),
    "rounding test_growth": ("", "terms $n$", r"error of the sum / $\beta\sum|x_j|$"),
    "rounding test_pessimism": ("", "products $n$", "error / bound"),
    "rounding test_sawtooth[chop]": (
        r"chop, 2 decimal digits: bound $\beta$, (13)",
        "number $x$",
        "relative error",
    ),
    "rounding test_sawtooth[nearest]": (
        r"nearest, 2 decimal digits: bound $\beta$, (8)",
        "number $x$",
        "relative error",
    ),
    "rounding test_worst_ratios": ("", "factors $n$", "worst error / bound (20)"),
    "wordlengths test_bands": ("", "bits", "largest error / tolerance"),
    "wordlengths test_changes": ("", "error / error with ties away and any exponent", ""),
    "wordlengths test_growth": ("", "steps $k$", "bits needed for the tolerance"),
    "wordlengths test_overview": ("", "bits", ""),
}
