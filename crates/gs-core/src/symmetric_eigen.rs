//! Eigenvalues of small symmetric matrices.

/// Eigenvalues (unordered) and unit eigenvectors (columns, in the same order) of a symmetric
/// matrix, by cyclic Jacobi rotations. Accurate to rounding for any symmetric matrix, including
/// repeated eigenvalues; meant for small `N`.
pub fn symmetric_eigen<const N: usize>(mut a: [[f64; N]; N]) -> ([f64; N], [[f64; N]; N]) {
    let mut v = [[0.0; N]; N];
    for (i, row) in v.iter_mut().enumerate() {
        row[i] = 1.0;
    }
    let total: f64 = a.iter().flatten().map(|x| x * x).sum();
    for _ in 0..12 {
        let mut off = 0.0;
        for i in 0..N {
            for j in i + 1..N {
                off += a[i][j] * a[i][j];
            }
        }
        if off <= 1e-30 * total {
            break;
        }
        for p in 0..N {
            for q in p + 1..N {
                jacobi_rotate(&mut a, &mut v, p, q);
            }
        }
    }
    (std::array::from_fn(|i| a[i][i]), v)
}

fn jacobi_rotate<const N: usize>(a: &mut [[f64; N]; N], v: &mut [[f64; N]; N], p: usize, q: usize) {
    if a[p][q] == 0.0 {
        return;
    }
    let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
    let t = theta.signum() / (theta.abs() + theta.mul_add(theta, 1.0).sqrt());
    let t = if theta == 0.0 { 1.0 } else { t };
    let c = 1.0 / t.mul_add(t, 1.0).sqrt();
    let s = t * c;
    for row in a.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
    for i in 0..N {
        (a[p][i], a[q][i]) = (c * a[p][i] - s * a[q][i], s * a[p][i] + c * a[q][i]);
    }
    for row in v.iter_mut() {
        (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigendecomposition_reconstructs_the_matrix() {
        let a = [[4.0, 1.0, -2.0], [1.0, 3.0, 0.5], [-2.0, 0.5, 1.0]];
        let (values, v) = symmetric_eigen(a);
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 = (0..3).map(|k| v[i][k] * values[k] * v[j][k]).sum();
                assert!((sum - a[i][j]).abs() < 1e-12, "entry {i},{j}: {sum}");
            }
        }
        assert_eq!(symmetric_eigen([[0.0; 3]; 3]).0, [0.0; 3], "no direction");
    }
}
