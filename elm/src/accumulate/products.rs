//! Sums of products in the place of the triangle, where a given strength of ridge leaves these their digits.
//!
//! They cost half the arithmetic of a triangle, and merging adds them up. With an intercept they are those of
//! centered columns, and merged by the distance of the means (Chan, Golub and LeVeque, Algorithms for Computing
//! the Sample Variance, 1983, for one column), so that no sum is a small difference of large ones, in whatever
//! order the rows come.

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
        let scales = largest(&rows).mapv_into(power_of_two);
        rows /= &scales;
        // The lower half by columns is the upper half by rows.
        let mut products = A::gram(rows.view()).reversed_axes();
        if self.intercept {
            products.slice_mut(s![0, 1..]).fill(A::zero());
        }
        self.add_products(&products, &scales, means.as_ref())
    }

    /// Takes in sums of products of columns that were divided by `scales`, about these means.
    pub(super) fn add_products(
        &mut self,
        products: &Array2<A>,
        scales: &Array1<A>,
        means: Option<&Array1<A>>,
    ) -> Result<()> {
        // The larger unit of a column that is not 0 in both.
        let units = |sums: &Array2<A>, scales: &Array1<A>| {
            let used = |(&sum, &scale): (&A, &A)| if sum > A::zero() { scale } else { A::zero() };
            sums.diag()
                .iter()
                .zip(scales)
                .map(used)
                .collect::<Array1<A>>()
        };
        let (ours, theirs) = (units(&self.kept, &self.scales), units(products, scales));
        let mut common = Array1::ones(ours.len());
        Zip::from(&mut common)
            .and(&ours)
            .and(&theirs)
            .for_each(|to, &a, &b| {
                if a.max(b) > A::zero() {
                    *to = a.max(b);
                }
            });
        let (ours, theirs) = (ours / &common, theirs / &common);
        let mut apart = None;
        if let (Some(means), Some(own)) = (means, &mut self.shift) {
            let (mine, others) = (
                self.kept[[0, 0]] * ours[0] * ours[0],
                products[[0, 0]] * theirs[0] * theirs[0],
            );
            let share = others / (mine + others);
            if mine > A::zero() && others > A::zero() {
                let distance = means - &*own;
                own.scaled_add(share, &distance);
                let root = (mine * share).sqrt() * common[0];
                apart = Some(distance * root / common.slice(s![1..]));
            } else if others > A::zero() {
                own.assign(means);
            }
        } else if let Some(means) = means {
            self.shift = Some(means.clone());
        }
        for (i, mut row) in self.kept.rows_mut().into_iter().enumerate() {
            let columns = row.iter_mut().zip(products.row(i)).zip(&ours).zip(&theirs);
            for (((to, &more), &mine), &others) in columns.skip(i) {
                *to = *to * ours[i] * mine + more * theirs[i] * others;
            }
        }
        if let Some(apart) = apart {
            let mut centered = self.kept.slice_mut(s![1.., 1..]);
            for (i, mut row) in centered.rows_mut().into_iter().enumerate() {
                row.slice_mut(s![i..])
                    .scaled_add(apart[i], &apart.slice(s![i..]));
            }
        }
        self.scales = common;
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
