//! Networks of a stated size for timing, fitted to noise: what they predict does not matter.

use elm::solve::Ridge;
use elm::{Activation, Elm, ElmParams, Error, Scalar};
use ndarray::Array2;

/// Values spread evenly over [-1.7, 1.7), the same in every run.
#[must_use]
pub fn rows<A: Scalar>(rows: usize, columns: usize) -> Array2<A> {
    let mut state = 0.5_f64;
    Array2::from_shape_simple_fn((rows, columns), || {
        state = (state + 0.618_033_988_749_894_9).fract();
        A::from_f64(3.4 * state - 1.7)
    })
}

/// A network with these sizes.
///
/// # Errors
/// Those of [`ElmParams::fit`].
pub fn network<A: Scalar>(
    inputs: usize,
    neurons: usize,
    outputs: usize,
    activation: Activation<A>,
) -> Result<Elm<A>, Error> {
    ElmParams::new(neurons)
        .with_activation(activation)
        .with_solver(Ridge::relative(1e-3))
        .fit(&rows(64, inputs), &rows(64, outputs))
}
