//! Gradients of weighted sums of neurons with respect to the inputs.

use ndarray::{Array1, Array2, ArrayView1, ArrayView2, Axis, Zip, s};

use super::distance;
use super::layer::{HiddenLayer, NeuronBlock};
use crate::scalar::Scalar;

/// The step that differences of activation functions are taken over, in units of what a step of one
/// along a typical input is to the neuron: what matters at the scale of the data, not of the wiggles.
const STEP: f64 = 0.25;

impl<A: Scalar> HiddenLayer<A> {
    /// The gradient of each row's $\sum_k \beta_k f_k(x)$, shape (rows, inputs), for inputs as the
    /// layer takes them, shape (rows, inputs), and one output's weight per neuron.
    ///
    /// The derivative of $f_k$ is a central difference, so that any function has one, over a
    /// quarter of the neuron's mean weight. Two products of matrices, whatever the number of inputs.
    pub(crate) fn gradient(&self, x: ArrayView2<'_, A>, beta: ArrayView1<'_, A>) -> Array2<A> {
        let mut gradient = Array2::zeros(x.dim());
        let mut first = 0;
        for group in &self.groups {
            let columns = first..first + group.neurons;
            first = columns.end;
            let weights = self.weights.slice(s![.., columns.clone()]);
            let beta = beta.slice(s![columns.clone()]);
            match &group.radial {
                None => {
                    let biases = self.biases.slice(s![columns]);
                    gradient += &of_projections(group, weights, biases, x, beta);
                }
                Some(scales) => gradient += &of_distances(group, weights, scales, x, beta),
            }
        }
        gradient
    }
}

fn root_mean_square<A: Scalar>(values: ArrayView1<'_, A>) -> A {
    let count = A::from_f64(values.len().max(1) as f64);
    (values.dot(&values) / count).sqrt()
}

fn of_projections<A: Scalar>(
    group: &NeuronBlock<A>,
    weights: ArrayView2<'_, A>,
    biases: ArrayView1<'_, A>,
    x: ArrayView2<'_, A>,
    beta: ArrayView1<'_, A>,
) -> Array2<A> {
    let steps = weights.map_axis(Axis(0), |own| A::from_f64(STEP) * root_mean_square(own));
    let z = A::product(x, weights) + biases;
    let mut slopes = &z + &steps;
    group.activation.apply_in_place(slopes.view_mut());
    let mut below = z - &steps;
    group.activation.apply_in_place(below.view_mut());
    slopes -= &below;
    let factors = Zip::from(&steps).and(beta).map_collect(|&step, &beta| {
        if step > A::zero() {
            beta / (step + step)
        } else {
            A::zero()
        }
    });
    slopes *= &factors;
    A::product(slopes.view(), weights.t())
}

/// With distance $z = \lVert s \circ x - c \rVert$ the slope along input $j$ is
/// $f'(z) s_j (s_j x_j - c_j) / z$.
fn of_distances<A: Scalar>(
    group: &NeuronBlock<A>,
    centers: ArrayView2<'_, A>,
    scales: &Array1<A>,
    x: ArrayView2<'_, A>,
    beta: ArrayView1<'_, A>,
) -> Array2<A> {
    let step = A::from_f64(STEP) * root_mean_square(scales.view());
    let x = &x * scales;
    let z = distance::distances(x.view(), centers);
    let mut slopes = &z + step;
    group.activation.apply_in_place(slopes.view_mut());
    let mut below = z.mapv(|z| (z - step).max(A::zero()));
    group.activation.apply_in_place(below.view_mut());
    slopes -= &below;
    for (mut row, z) in slopes.rows_mut().into_iter().zip(z.rows()) {
        Zip::from(&mut row)
            .and(z)
            .and(beta)
            .for_each(|slope, &z, &beta| {
                // At its center a neuron is level.
                *slope = if z > A::zero() {
                    *slope * beta / ((step + step.min(z)) * z)
                } else {
                    A::zero()
                };
            });
    }
    let mut gradient = A::product(slopes.view(), centers.t());
    let sums = slopes.sum_axis(Axis(1)).insert_axis(Axis(1));
    gradient.zip_mut_with(&(&x * &sums), |g, &own| *g = own - *g);
    gradient *= scales;
    gradient
}
