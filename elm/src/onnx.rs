//! Networks as ONNX files (feature `onnx`), for any runtime that reads these: onnxruntime and others.
//!
//! The graph of a [`network`] or [`classifier`] has one input `x` of shape (rows, inputs), rows free. A
//! network has one output `y` of shape (rows, outputs); a classifier has `label`, the index of the class, and
//! `probabilities` of shape (rows, classes). All is computed in double precision, whatever the types of
//! inputs and outputs are, as sums of hundreds of neurons cancel; inputs and predictions are held to the
//! network's [bounds](crate::bounds). A [`Graph`] of one's own puts more around a network.
//!
//! ```
//! use elm::{ElmParams, onnx};
//! use ndarray::array;
//!
//! let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![0.0, 1.0, 4.0, 9.0]);
//! let model = ElmParams::new(10).fit(&x, &t)?;
//! let bytes = onnx::network(&model, onnx::Precision::Double)?;
//! assert!(bytes.len() > 100);
//! # Ok::<(), elm::Error>(())
//! ```

mod graph;
mod proto;

use ndarray::{Array2, ArrayView1};

use crate::activation::Activation;
use crate::classify::ElmClassifier;
use crate::dataset::TargetDim;
use crate::error::{Error, Result};
use crate::feature_map::NeuronBlock;
use crate::network::Elm;
use crate::scalar::Scalar;
pub use graph::{Graph, Value};

/// The type of a graph's inputs and outputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Precision {
    /// `f32`.
    Single,
    /// `f64`.
    #[default]
    Double,
}

/// The graph of a network.
///
/// # Errors
/// [`Error::Conflict`] for an activation function of one's own, which is code.
pub fn network<A: Scalar, D: TargetDim>(
    model: &Elm<A, D>,
    precision: Precision,
) -> Result<Vec<u8>> {
    let mut graph = Graph::new(precision);
    let x = graph.input("x", model.inputs());
    let y = graph.network(model, &x)?;
    graph.output("y", &y, model.outputs());
    Ok(graph.finish())
}

/// The graph of a classifier.
///
/// # Errors
/// Those of [`network`].
pub fn classifier<A: Scalar, L: Ord + Clone>(
    model: &ElmClassifier<A, L>,
    precision: Precision,
) -> Result<Vec<u8>> {
    let mut graph = Graph::new(precision);
    let x = graph.input("x", model.model().inputs());
    let mut z = graph.network(model.model(), &x)?;
    let (calibration, classes) = (model.calibration(), model.classes().len());
    let shifts = calibration.shifts();
    if classes == 2 {
        // Log-odds 0 of the first class, and those of the second: slope (2 f - 1) + shift.
        let slope = graph.matrix(&Array2::from_shape_fn((1, 2), |(_, class)| {
            2.0 * calibration.slope() * class as f64
        }));
        let shift = shifts[1] - shifts[0] - calibration.slope();
        let shift = graph.row(&[0.0, shift]);
        z = graph.node("MatMul", &[&z, &slope]);
        z = graph.node("Add", &[&z, &shift]);
    } else {
        let slope = graph.row(&[calibration.slope()]);
        let shift = graph.row(shifts);
        z = graph.node("Mul", &[&z, &slope]);
        z = graph.node("Add", &[&z, &shift]);
    }
    let label = graph.along("ArgMax", &[&z], 1, Some(0));
    let p = graph.along("Softmax", &[&z], 1, None);
    graph.label("label", &label);
    graph.output("probabilities", &p, classes);
    Ok(graph.finish())
}

/// The nodes of a network's predictions, held to their bounds.
fn predictions<A: Scalar, D: TargetDim>(
    graph: &mut Graph,
    model: &Elm<A, D>,
    x: &Value,
) -> Result<Value> {
    let wide =
        |values: ArrayView1<'_, A>| -> Vec<f64> { values.iter().map(|v| v.as_f64()).collect() };
    let mut x = x.clone();
    let held = model.bounds().filter(|bounds| bounds.are_held());
    if let Some(bounds) = held {
        let (lower, upper) = bounds.held_inputs();
        x = hold(graph, x, &wide(lower.view()), &wide(upper.view()));
    }
    if let Some(scaler) = model.scaler() {
        let (mean, factor) = (wide(scaler.mean()), wide(scaler.factor()));
        let (mean, factor) = (graph.row(&mean), graph.row(&factor));
        x = graph.node("Sub", &[&x, &mean]);
        x = graph.node("Mul", &[&x, &factor]);
    }
    let layer = model.hidden();
    let mut parts = Vec::new();
    let mut first = 0;
    for group in layer.groups() {
        let columns = ndarray::s![.., first..first + group.neurons()];
        let weights = layer.weights().slice(columns).mapv(A::as_f64);
        let biases = layer
            .biases()
            .slice(ndarray::s![first..first + group.neurons()])
            .to_owned();
        let z = arguments(graph, &x, group, &weights, &wide(biases.view()));
        parts.push(activate(graph, group.activation(), z)?);
        first += group.neurons();
    }
    if model.map().direct_links() {
        parts.push(x);
    }
    let parts: Vec<&Value> = parts.iter().collect();
    let h = graph.concatenate(&parts);
    let beta = graph.matrix(&model.beta().mapv(A::as_f64));
    let intercept = graph.row(&wide(model.intercept()));
    let mut y = graph.node("MatMul", &[&h, &beta]);
    y = graph.node("Add", &[&y, &intercept]);
    if let Some(bounds) = held {
        let (lower, upper) = bounds.predictions();
        y = hold(graph, y, &wide(lower.view()), &wide(upper.view()));
    }
    Ok(y)
}

fn hold(graph: &mut Graph, x: Value, lower: &[f64], upper: &[f64]) -> Value {
    let (lower, upper) = (graph.row(lower), graph.row(upper));
    let x = graph.node("Max", &[&x, &lower]);
    graph.node("Min", &[&x, &upper])
}

/// What the function of a group is applied to.
fn arguments<A: Scalar>(
    graph: &mut Graph,
    x: &Value,
    group: &NeuronBlock<A>,
    weights: &Array2<f64>,
    biases: &[f64],
) -> Value {
    let Some(scales) = group.input_scales() else {
        let (weights, biases) = (graph.matrix(weights), graph.row(biases));
        let z = graph.node("MatMul", &[x, &weights]);
        return graph.node("Add", &[&z, &biases]);
    };
    // By differences, as the library takes distances: (rows, 1, inputs) less (neurons, inputs).
    let scales: Vec<f64> = scales.iter().map(|s| s.as_f64()).collect();
    let (scales, centers) = (graph.row(&scales), graph.matrix(&weights.t().to_owned()));
    let x = graph.node("Mul", &[x, &scales]);
    let one = graph.integers(&[1]);
    let x = graph.node("Unsqueeze", &[&x, &one]);
    let apart = graph.node("Sub", &[&x, &centers]);
    let squares = graph.node("Mul", &[&apart, &apart]);
    let last = graph.integers(&[2]);
    let sum = graph.sum_without(&squares, &last);
    graph.node("Sqrt", &[&sum])
}

fn activate<A: Scalar>(graph: &mut Graph, f: &Activation<A>, z: Value) -> Result<Value> {
    Ok(match f {
        Activation::Sigmoid => graph.node("Sigmoid", &[&z]),
        Activation::Tanh => graph.node("Tanh", &[&z]),
        Activation::Sine => graph.node("Sin", &[&z]),
        Activation::Gaussian => {
            let square = graph.node("Mul", &[&z, &z]);
            let less = graph.node("Neg", &[&square]);
            graph.node("Exp", &[&less])
        }
        Activation::Relu => graph.node("Relu", &[&z]),
        Activation::SquaredRelu => {
            let rectified = graph.node("Relu", &[&z]);
            graph.node("Mul", &[&rectified, &rectified])
        }
        Activation::HardLimit => {
            let zero = graph.row(&[0.0]);
            let at_least = graph.node("GreaterOrEqual", &[&z, &zero]);
            graph.cast(&at_least, Precision::Double)
        }
        Activation::Isru => {
            let one = graph.row(&[1.0]);
            let square = graph.node("Mul", &[&z, &z]);
            let more = graph.node("Add", &[&square, &one]);
            let root = graph.node("Sqrt", &[&more]);
            graph.node("Div", &[&z, &root])
        }
        Activation::Linear => z,
        Activation::Custom(_) => {
            return Err(Error::Conflict {
                first: "an activation function of one's own",
                second: "a file",
            });
        }
    })
}
