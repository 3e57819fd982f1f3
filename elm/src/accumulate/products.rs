//! Sums of products in the place of the triangle, where a given strength of ridge leaves these their digits.
//!
//! They cost half the arithmetic of a triangle, and merging adds them up. With an intercept they are those of
//! centered columns, and merged by the distance of the means (Chan, Golub and LeVeque, Algorithms for
//! Computing the Sample Variance, 1983, for one column), so that no sum is a small difference of large ones,
//! in whatever order the rows come.

use ndarray::{Array1, Array2, Axis, ShapeBuilder, Zip, s};

use super::shift::near_means;
use super::{Accumulator, OVERFLOW, largest};
use crate::dataset::TargetDim;
use crate::error::Result;
use crate::scalar::{Scalar, power_of_two};
use crate::solve::Solution;
use crate::solve::equilibration::Equilibration;
use crate::solve::normal_equations::NormalEquations;

impl<A: Scalar, D: TargetDim> Accumulator<A, D> {
    /// Whether sums of products are kept: with an intercept the first is that of the weights, the rest of its
    /// row is 0, and `shift` has the means.
    pub(super) fn keeps_products(&self) -> bool {
        self.solver.strength_for_products::<A>().is_some()
    }

    /// Takes in rows as they were pushed.
    pub(super) fn add_rows(&mut self, mut rows: Array2<A>) -> Result<()> {
        let mut means = None;
        if self.intercept {
            let found = near_means(&rows);
            for mut row in rows.rows_mut() {
                let root = row[0];
                row.slice_mut(s![1..]).scaled_add(-root, &found);
            }
            means = Some(found);
        }
        let units = largest(&rows).mapv_into(|size| match size == A::zero() {
            true => size,
            false => power_of_two(size),
        });
        self.share_units(&units);
        rows /= &self.scales;
        if let Some(means) = means {
            let roots = rows.column(0);
            self.share_means(&means, roots.dot(&roots));
        }
        // The lower half by columns is the upper half by rows.
        let kept = std::mem::replace(&mut self.kept, Array2::zeros((0, 0)));
        let mut sums = kept.reversed_axes();
        A::add_gram(rows.view(), &mut sums, &mut Vec::new());
        self.kept = sums.reversed_axes();
        for (i, mut row) in self.kept.rows_mut().into_iter().enumerate() {
            row.slice_mut(s![..i]).fill(A::zero());
        }
        if self.intercept {
            self.kept.slice_mut(s![0, 1..]).fill(A::zero());
        }
        self.check_range()
    }

    /// Takes in the sums of products of another with the same layer and settings.
    pub(super) fn add_products(&mut self, other: &Self) -> Result<()> {
        self.share_units(&other.units());
        let factors = other.units() / &self.scales;
        if let Some(means) = &other.shift {
            self.share_means(means, other.kept[[0, 0]] * factors[0] * factors[0]);
        }
        for (i, mut row) in self.kept.rows_mut().into_iter().enumerate() {
            Zip::from(row.slice_mut(s![i..]))
                .and(other.kept.slice(s![i, i..]))
                .and(factors.slice(s![i..]))
                .for_each(|to, &more, &factor| *to += more * factor * factors[i]);
        }
        self.check_range()
    }

    /// What each column was divided by; 0 for one that is 0.
    fn units(&self) -> Array1<A> {
        let unit = |(&sum, &scale): (&A, &A)| match sum > A::zero() {
            true => scale,
            false => A::zero(),
        };
        self.kept
            .diag()
            .iter()
            .zip(&self.scales)
            .map(unit)
            .collect()
    }

    /// Divides columns by larger powers of two where these units are larger.
    fn share_units(&mut self, others: &Array1<A>) {
        let own = self.units();
        let common: Array1<A> = own.iter().zip(others).map(|(a, b)| a.max(*b)).collect();
        self.scales = common.mapv(|unit| if unit > A::zero() { unit } else { A::one() });
        if own != common {
            let factors = own / &self.scales;
            self.kept *= &factors;
            self.kept *= &factors.insert_axis(Axis(1));
        }
    }

    /// Moves the means to those of the rows so far and of others, whose means these are and whose weight is
    /// in the units of the first column, and adds what the distance adds to the sums.
    fn share_means(&mut self, means: &Array1<A>, weight: A) {
        let Some(own) = &mut self.shift else {
            self.shift = Some(means.clone());
            return;
        };
        let before = self.kept[[0, 0]];
        if weight <= A::zero() {
            return;
        }
        if before <= A::zero() {
            own.assign(means);
            return;
        }
        let share = weight / (before + weight);
        let mut apart = means - &*own;
        own.scaled_add(share, &apart);
        apart *= (before * share).sqrt() * self.scales[0];
        apart /= &self.scales.slice(s![1..]);
        let mut centered = self.kept.slice_mut(s![1.., 1..]);
        for (i, mut row) in centered.rows_mut().into_iter().enumerate() {
            row.slice_mut(s![i..])
                .scaled_add(apart[i], &apart.slice(s![i..]));
        }
    }

    fn check_range(&self) -> Result<()> {
        if self.kept.iter().all(|sum| sum.is_finite()) {
            Ok(())
        } else {
            Err(OVERFLOW)
        }
    }

    /// The normal equations of all rows that have entered the sums.
    pub(super) fn moments(&self) -> Result<NormalEquations<A>> {
        let (hidden, targets) = self.places();
        let neurons = hidden.len();
        // Neurons share one scale, so that the singular values are those of the whole matrix.
        let used = |place: &usize| self.kept[[*place, *place]] > A::zero();
        let scales = hidden.clone().filter(used).map(|place| self.scales[place]);
        let hidden_scale = scales.reduce(A::max).unwrap_or(A::one());
        let units = &self.scales.slice(s![hidden.clone()]) / hidden_scale;
        let target_scale = self.scales.slice(s![targets.clone()]).to_owned();
        let mut gram = Array2::zeros((neurons, neurons).f());
        gram.assign(&self.kept.slice(s![hidden.clone(), hidden.clone()]).t());
        gram *= &units;
        gram *= &units.view().insert_axis(Axis(1));
        let mut right = self
            .kept
            .slice(s![hidden.clone(), targets.clone()])
            .to_owned();
        right *= &units.view().insert_axis(Axis(1));
        let mut squares = self.kept.diag().slice(s![targets.clone()]).to_owned();
        let mut frame = Equilibration {
            hidden_scale,
            target_scale,
            ..self.frame()
        };
        if self.intercept
            && let Some(means) = &self.shift
        {
            // Weights that have vanished leave no means.
            if self.kept[[0, 0]] <= A::zero() {
                return Err(OVERFLOW);
            }
            frame.hidden_mean = means.slice(s![..neurons]).to_owned();
            frame.target_mean = means.slice(s![neurons..]).to_owned();
            frame.total_weight = self.kept[[0, 0]] * self.scales[0] * self.scales[0];
            // What centering leaves of a constant is rounding, and would pass for a feature.
            let is_constant = |place: usize| {
                let deviation = (self.kept[[place, place]] / self.kept[[0, 0]]).sqrt();
                let unit = self.scales[place] / self.scales[0];
                deviation * unit <= A::from_f64(4.0) * A::epsilon() * means[place - 1].abs()
            };
            for (neuron, place) in hidden.enumerate() {
                if is_constant(place) {
                    gram.row_mut(neuron).fill(A::zero());
                    gram.column_mut(neuron).fill(A::zero());
                    right.row_mut(neuron).fill(A::zero());
                }
            }
            for (output, place) in targets.enumerate() {
                if is_constant(place) {
                    right.column_mut(output).fill(A::zero());
                    squares[output] = A::zero();
                }
            }
        }
        Ok(NormalEquations::of_centered(gram, right, squares, frame))
    }

    /// The output weights and what they cost, of all rows that have entered.
    pub(super) fn solve(&self) -> Result<Solution<A>> {
        if self.keeps_products()
            && let Some(solution) = self.solver.solve_moments(&self.moments()?)?
        {
            return Ok(solution);
        }
        self.solver.solve_spectrum(&self.spectrum()?)
    }
}
