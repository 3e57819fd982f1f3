//! The held-out residuals of one fold, in the coordinates of the factorization.

use std::collections::BTreeMap;

use ndarray::{Array1, Array2, Axis, s};

use super::CrossValidator;
use crate::check::check_length;
use crate::error::{Error, Result};
use crate::linalg::{CholeskySolve, QrFactor};
use crate::scalar::Scalar;
use crate::solve::norms::rounding;

/// Rows that are left out together.
#[derive(Debug, Clone)]
pub(super) struct Fold<A: Scalar> {
    pub(super) label: usize,
    /// Those whose weight is not 0.
    pub(super) rows: Vec<usize>,
    /// Those whose weight is 0, as places in the validator's list of them.
    pub(super) absent: Vec<usize>,
    form: Form<A>,
}

/// What of the fold's equations does not depend on the strength.
#[derive(Debug, Clone)]
enum Form<A: Scalar> {
    /// One equation per row: $(I - qq^T - UU^T)_{FF}$.
    Rows(Array2<A>),
    /// One equation per direction, $q$ first: the Gram matrix of $[q, U]$ over the rows that are
    /// left, and its product with their targets. Sums over the other folds, not differences from
    /// the whole.
    Directions(Array2<A>, Array2<A>),
}

/// Of one label nothing would be left to fit to.
///
/// # Errors
/// [`Error::Parameter`].
pub(crate) fn check_several(name: &'static str, labels: &[usize]) -> Result<()> {
    if labels.windows(2).any(|pair| pair[0] != pair[1]) {
        return Ok(());
    }
    Err(Error::Parameter {
        name,
        value: 1.0,
        expected: "at least 2 different ones, as rows of one are held out together",
    })
}

impl<A: Scalar> Fold<A> {
    /// Groups rows by label and prepares each group.
    pub(super) fn divide(validator: &CrossValidator<A>, labels: &[usize]) -> Result<Vec<Self>> {
        check_length("fold labels", labels.len(), validator.rows())?;
        let spectrum = &validator.rows.spectrum;
        let frame = &spectrum.frame;
        let mut groups: BTreeMap<usize, (Vec<usize>, Vec<usize>)> = BTreeMap::new();
        for (row, &label) in labels.iter().enumerate() {
            let (rows, absent) = groups.entry(label).or_default();
            match validator.absent.binary_search(&row) {
                Ok(place) => absent.push(place),
                Err(_) => rows.push(row),
            }
        }
        let directions = spectrum.s.len() + usize::from(frame.intercept);
        let mut small: Vec<usize> = Vec::new();
        let mut large = Vec::new();
        for (&label, (rows, _)) in &groups {
            // Nothing is left to place the intercept by.
            if frame.intercept && rows.len() == frame.weighted_rows {
                return Err(Error::Undetermined { fold: label });
            }
            if rows.len() > directions {
                large.push(label);
            } else {
                small.extend(rows);
            }
        }
        // At most rows / directions of these, so they take no more memory than the rows do.
        let moments = |rows: &[usize]| {
            let basis = validator.basis(rows);
            let targets = validator.inner_targets.select(Axis(0), rows);
            (
                A::product(basis.t(), basis.view()),
                A::product(basis.t(), targets.view()),
            )
        };
        let small = (!large.is_empty()).then(|| moments(&small));
        let large: Vec<_> = large
            .into_iter()
            .map(|label| (label, moments(&groups[&label].0)))
            .collect();
        let others = |label: usize| {
            let dimension = (directions, directions);
            let start = small.clone().unwrap_or_else(|| {
                (
                    Array2::zeros(dimension),
                    Array2::zeros((directions, validator.outputs())),
                )
            });
            large
                .iter()
                .filter(|(other, _)| *other != label)
                .fold(start, |sum, (_, (gram, product))| {
                    (sum.0 + gram, sum.1 + product)
                })
        };
        Ok(groups
            .into_iter()
            .map(|(label, (rows, absent))| {
                let form = if rows.len() > directions {
                    let (gram, product) = others(label);
                    Form::Directions(gram, product)
                } else {
                    Form::Rows(validator.gap(&rows))
                };
                Self {
                    label,
                    rows,
                    absent,
                    form,
                }
            })
            .collect())
    }

    /// The held-out residuals of [`rows`](Self::rows), shape (rows, `outputs`), in the units of
    /// the factorization.
    pub(super) fn residuals(
        &self,
        validator: &CrossValidator<A>,
        strength: A,
        outputs: &[usize],
    ) -> Result<Array2<A>> {
        if self.rows.is_empty() {
            return Ok(Array2::zeros((0, outputs.len())));
        }
        let residuals = match &self.form {
            Form::Rows(gap) => self.by_rows(validator, gap, strength, outputs)?,
            Form::Directions(gram, product) => {
                let product = product.select(Axis(1), outputs);
                self.by_directions(validator, gram, &product, strength, outputs)?
            }
        };
        if residuals.iter().all(|e| e.is_finite()) {
            Ok(residuals)
        } else {
            Err(self.undetermined())
        }
    }

    fn undetermined(&self) -> Error {
        Error::Undetermined { fold: self.label }
    }

    /// $\big((I - qq^T - UU^T)_{FF} + U_F f U_F^T\big) e = r_F$.
    fn by_rows(
        &self,
        validator: &CrossValidator<A>,
        gap: &Array2<A>,
        strength: A,
        outputs: &[usize],
    ) -> Result<Array2<A>> {
        let spectrum = &validator.rows.spectrum;
        let complements = spectrum.filter_complements(strength);
        let u = validator.rows.u.select(Axis(0), &self.rows);
        let c = spectrum.c.select(Axis(1), outputs);
        let residual = validator.rows.residual.select(Axis(1), outputs);
        let u_held = &u * &complements;
        let matrix = gap + &A::product(u_held.view(), u.t());
        let right = residual.select(Axis(0), &self.rows) + A::product(u_held.view(), c.view());
        // With everything spanned the gap is exactly 0, and errors are relative to what is left.
        let noise = if validator.spanned() {
            matrix.diag().iter().fold(A::zero(), |m, d| m.max(*d))
        } else {
            A::one()
        };
        if let Some(solution) = solve_if_stable(&matrix, &right, noise) {
            return Ok(solution);
        }
        // The same equations as the least-squares problem that they are the normal equations of,
        // which has the root of their condition: the fold's unit vectors off the span, over the
        // part of them that is held back.
        let mut units = Array2::zeros((validator.rows(), self.rows.len()));
        if !validator.spanned() {
            for (column, &row) in self.rows.iter().enumerate() {
                units[[row, column]] = A::one();
            }
            units = validator.rows.off_span(units);
            let level = spectrum.level();
            for mut column in units.columns_mut() {
                if column.dot(&column).sqrt() <= level {
                    column.fill(A::zero());
                }
            }
        }
        let root = complements.mapv(A::sqrt).insert_axis(Axis(1));
        let lower = &u.t() * &root;
        let matrix = stack(&units, &lower);
        let right = stack(&residual, &(&c * &root));
        self.least_squares(validator, strength, noise.sqrt(), &matrix, &right)
    }

    /// The fit to the rows that are left, in coordinates $x = \gamma / \sqrt{1 - f}$ in which the
    /// equations are $\sqrt{1-f}\, [q, U]^T [q, U] \sqrt{1-f} + \operatorname{diag}(f)$.
    fn by_directions(
        &self,
        validator: &CrossValidator<A>,
        gram: &Array2<A>,
        product: &Array2<A>,
        strength: A,
        outputs: &[usize],
    ) -> Result<Array2<A>> {
        let spectrum = &validator.rows.spectrum;
        let extra = usize::from(spectrum.frame.intercept);
        // The intercept is not held back.
        let mut kept_root = Array1::ones(gram.nrows());
        let mut complements = Array1::zeros(gram.nrows());
        kept_root
            .slice_mut(s![extra..])
            .assign(&spectrum.filter_factors(strength).mapv(A::sqrt));
        complements
            .slice_mut(s![extra..])
            .assign(&spectrum.filter_complements(strength));
        let column = kept_root.view().insert_axis(Axis(1));
        let mut matrix = gram * &kept_root * column;
        let mut diagonal = matrix.diag_mut();
        diagonal += &complements;
        let right = product * &column;
        let solution = match solve_if_stable(&matrix, &right, A::one()) {
            Some(solution) => solution,
            None => {
                let left: Vec<usize> = (0..validator.rows())
                    .filter(|row| self.rows.binary_search(row).is_err())
                    .collect();
                let upper = validator.basis(&left) * &kept_root;
                let matrix = stack(&upper, &Array2::from_diag(&complements.mapv(A::sqrt)));
                let targets = validator.inner_targets.select(Axis(0), &left);
                let targets = targets.select(Axis(1), outputs);
                let right = stack(&targets, &Array2::zeros(product.dim()));
                self.least_squares(validator, strength, A::one(), &matrix, &right)?
            }
        };
        let gamma = solution * column;
        let targets = validator.inner_targets.select(Axis(0), &self.rows);
        let fitted = A::product(validator.basis(&self.rows).view(), gamma.view());
        Ok(targets.select(Axis(1), outputs) - fitted)
    }

    /// Least squares by QR; an error when the matrix is singular at the level of rounding in
    /// entries of the size `scale`.
    fn least_squares(
        &self,
        validator: &CrossValidator<A>,
        strength: A,
        scale: A,
        matrix: &Array2<A>,
        right: &Array2<A>,
    ) -> Result<Array2<A>> {
        let QrFactor { r, qtb, .. } = A::triangularize(matrix.view(), right.view())?;
        let singular = A::singular_values(r.view())?;
        let level = rounding::<A>(matrix.nrows(), matrix.ncols()) * scale;
        let level = level.max(validator.singular_level(strength));
        match singular.last() {
            Some(&smallest) if smallest > level => {
                A::solve_square(r.view(), qtb.view()).map_err(|_| self.undetermined())
            }
            _ => Err(self.undetermined()),
        }
    }
}

impl<A: Scalar> CrossValidator<A> {
    fn spanned(&self) -> bool {
        let spectrum = &self.rows.spectrum;
        spectrum.frame.spanned_by(spectrum.s.len())
    }

    /// These rows of $[q, U]$, or of $U$ without an intercept.
    fn basis(&self, rows: &[usize]) -> Array2<A> {
        let extra = usize::from(self.rows.spectrum.frame.intercept);
        let mut basis = Array2::zeros((rows.len(), self.rows.u.ncols() + extra));
        for (mut target, &row) in basis.rows_mut().into_iter().zip(rows) {
            if extra == 1 {
                target[0] = self.rows.constant[row];
            }
            target.slice_mut(s![extra..]).assign(&self.rows.u.row(row));
        }
        basis
    }

    /// $(I - qq^T - UU^T)_{FF}$.
    fn gap(&self, rows: &[usize]) -> Array2<A> {
        if self.spanned() {
            return Array2::zeros((rows.len(), rows.len()));
        }
        let basis = self.basis(rows);
        let mut gap = A::product(basis.view(), basis.t()).mapv_into(|v| -v);
        for (place, &row) in rows.iter().enumerate() {
            gap[[place, place]] = if rows.len() == 1 {
                self.rows.one_minus_leverage[row]
            } else {
                gap[[place, place]] + A::one()
            };
        }
        gap
    }
}

/// Solves positive definite equations by Cholesky where that keeps three quarters of the digits,
/// given rounding errors of epsilon times `noise` in the matrix: the trace of the inverse bounds
/// what they are amplified by.
fn solve_if_stable<A: Scalar>(
    matrix: &Array2<A>,
    right: &Array2<A>,
    noise: A,
) -> Option<Array2<A>> {
    let CholeskySolve { x, inverse_trace } = A::solve_positive(matrix.view(), right.view()).ok()?;
    // Equations that are all alike are as stable as one of them.
    let amplification = inverse_trace * noise - A::from_f64(matrix.nrows() as f64);
    let limit = A::epsilon().sqrt().sqrt().recip();
    (amplification <= limit).then_some(x)
}

/// One matrix above another of as many columns.
fn stack<A: Scalar>(upper: &Array2<A>, lower: &Array2<A>) -> Array2<A> {
    let rows = upper.nrows();
    let mut both = Array2::zeros((rows + lower.nrows(), upper.ncols()));
    both.slice_mut(s![..rows, ..]).assign(upper);
    both.slice_mut(s![rows.., ..]).assign(lower);
    both
}
