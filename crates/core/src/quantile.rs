//! Quantiles of Student's t.

/// The 97.5 % quantile of Student's t with `dof` degrees of freedom.
pub(crate) fn student_t_975(dof: f64) -> f64 {
    let z = 1.959963984540054_f64;
    let (z3, z5, z7) = (z.powi(3), z.powi(5), z.powi(7));
    z + (z3 + z) / (4.0 * dof)
        + (5.0 * z5 + 16.0 * z3 + 3.0 * z) / (96.0 * dof * dof)
        + (3.0 * z7 + 19.0 * z5 + 17.0 * z3 - 15.0 * z) / (384.0 * dof.powi(3))
}
