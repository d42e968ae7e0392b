//! Student's t, for intervals whose noise is estimated from the record itself.

use std::f64::consts::PI;

/// Beyond as many degrees of freedom the expansion about the normal distribution is exact to 1e-9.
const LARGE: f64 = 60.0;
/// 0.975 quantile of the normal distribution.
pub(crate) const NORMAL: f64 = 1.959_963_984_540_054;

/// The 0.975 quantile of Student's t with `dof` >= 1 degrees of freedom, not necessarily whole; relative error below 1e-8.
///
/// Half the width of a 95 % interval in standard errors. Newton's method on the tail, Abramowitz and Stegun 26.5.8 (continued
/// fraction); 26.7.5 (expansion) from 60 degrees of freedom on.
pub(crate) fn student_t_975(dof: f64) -> f64 {
    debug_assert!(dof >= 1.0, "{dof} degrees of freedom");
    if dof >= LARGE {
        return expansion(dof);
    }
    // The tail is convex, so that Newton's steps from the left never pass the root.
    let mut t = NORMAL;
    let slope_at_zero = gamma_ratio(dof / 2.0) / (PI * dof).sqrt();
    for _ in 0..50 {
        let density = slope_at_zero * (1.0 + t * t / dof).powf(-(dof + 1.0) / 2.0);
        let step = (two_tails(t, dof) - 0.05) / (2.0 * density);
        t += step;
        if step.abs() < 1e-12 * t {
            break;
        }
    }
    t
}

/// t = z + sum g_j(z) / dof^j.
fn expansion(dof: f64) -> f64 {
    let z = NORMAL;
    let z2 = z * z;
    let terms = [
        z * (z2 + 1.0) / 4.0,
        z * ((5.0 * z2 + 16.0) * z2 + 3.0) / 96.0,
        z * (((3.0 * z2 + 19.0) * z2 + 17.0) * z2 - 15.0) / 384.0,
        z * ((((79.0 * z2 + 776.0) * z2 + 1482.0) * z2 - 1920.0) * z2 - 945.0) / 92160.0,
    ];
    terms.iter().rev().fold(0.0, |sum, term| (sum + term) / dof) + z
}

/// P(|T| > t) = I_x(dof / 2, 1 / 2) with x = dof / (dof + t^2), for t from the normal quantile on, where the fraction converges.
fn two_tails(t: f64, dof: f64) -> f64 {
    let (a, b) = (dof / 2.0, 0.5);
    let x = dof / (dof + t * t);
    let front = gamma_ratio(a) / PI.sqrt() * x.powf(a) * (1.0 - x).sqrt() / a;
    // 1 / (1 + d_1 / (1 + d_2 / ...)), by Lentz's method.
    let (mut fraction, mut c, mut d) = (1.0, 1.0, 0.0);
    for i in 1..500 {
        let m = f64::from(i / 2);
        let coefficient = if i % 2 == 1 {
            -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0))
        } else {
            m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m))
        };
        d = 1.0 / (1.0 + coefficient * d);
        c = 1.0 + coefficient / c;
        fraction *= c * d;
        if (c * d - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front / fraction
}

/// Gamma(a + 1/2) / Gamma(a): its asymptotic series where that is exact, and the recurrence down to a.
fn gamma_ratio(a: f64) -> f64 {
    let (mut at, mut factor) = (a, 1.0);
    while at < 20.0 {
        factor *= at / (at + 0.5);
        at += 1.0;
    }
    let r = 1.0 / at;
    let series =
        1.0 + r * (-1.0 / 8.0 + r * (1.0 / 128.0 + r * (5.0 / 1024.0 + r * (-21.0 / 32768.0 - r * 399.0 / 262_144.0))));
    factor * at.sqrt() * series
}

#[cfg(test)]
mod tests {
    use super::student_t_975;

    /// Degrees of freedom and scipy.stats.t.ppf(0.975, dof) (SciPy 1.17).
    const SCIPY: [(f64, f64); 20] = [
        (1.0, 12.706204736174694),
        (1.2, 8.648826510748867),
        (1.5, 6.016663104427929),
        (2.0, 4.302652729749462),
        (2.7, 3.3921483831737507),
        (3.0, 3.1824463052837078),
        (4.0, 2.7764451051977934),
        (5.5, 2.501858617589239),
        (8.0, 2.306004135204166),
        (12.25, 2.1738913883920628),
        (20.0, 2.085963447265864),
        (31.4, 2.038460929876268),
        (45.0, 2.014103388880846),
        (59.9, 2.0003665086108584),
        (60.0, 2.0002978220142604),
        (75.0, 1.9921021540022417),
        (100.0, 1.9839715185235518),
        (400.0, 1.9659123432294627),
        (10000.0, 1.960201239890626),
        (1000000000.0, 1.959963986912325),
    ];

    #[test]
    fn quantiles_are_those_of_scipy() {
        for (dof, expected) in SCIPY {
            let found = student_t_975(dof);
            assert!((found / expected - 1.0).abs() < 1e-8, "{dof}: {found} for {expected}");
        }
    }
}
