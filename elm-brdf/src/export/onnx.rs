//! A model as an ONNX graph, for onnxruntime and whatever else reads these.

use std::mem::discriminant;

use elm::onnx::{Graph, Precision, Value};
use ndarray::Array2;

use super::error::ExportError;
use super::expression::{Expression, Function, Operator};
use super::inputs;
use crate::error::Result;
use crate::features::Features;
use crate::model::BrdfModel;
use crate::target_transform::{Channel, FittedTransform};
use elm_datasets::Brdf;

/// The graph of a model: inputs `light` and `viewer` of shape (rows, 3), vectors in the surface's frame, the
/// normal along $+z$, which the graph makes unit vectors; output `values` of shape (rows, channels), BRDF
/// in 1/sr. Black below either horizon. Metadata name the channels and the data.
///
/// All is computed in double precision, and agrees with the model to rounding; `precision` is that of inputs
/// and outputs.
///
/// # Errors
/// [`ExportError::Input`] for an input without a formula; [`Error::Elm`](crate::Error::Elm) for an activation
/// function of one's own.
pub fn onnx(model: &BrdfModel, precision: Precision) -> Result<Vec<u8>> {
    let mut graph = Graph::new(precision);
    let light = graph.input("light", 3);
    let viewer = graph.input("viewer", 3);
    let light = unit(&mut graph, &light);
    let viewer = unit(&mut graph, &viewer);
    let names = ["ix", "iy", "iz", "ox", "oy", "oz"];
    let components = names.into_iter().zip(light.iter().chain(&viewer).cloned());
    let mut values = Values {
        graph: &mut graph,
        known: components.collect(),
    };
    let features = values.features(model.features())?;
    let targets = graph.network(model.network(), &features)?;
    let values = values_of(&mut graph, model.target_transform(), &targets);
    let zero = graph.row(&[0.0]);
    let mut lit = graph.node("Min", &[&light[2], &viewer[2]]);
    lit = graph.node("Greater", &[&lit, &zero]);
    let values = graph.node("Where", &[&lit, &values, &zero]);
    graph.output("values", &values, model.channels());
    let about = model.provenance();
    graph.describe("channels", &about.channels.join(","));
    graph.describe("data", &about.data);
    Ok(graph.finish())
}

/// The components of vectors divided by their lengths.
fn unit(graph: &mut Graph, vectors: &Value) -> Vec<Value> {
    let squares = graph.node("Mul", &[vectors, vectors]);
    let squares = graph.columns(&squares, 3);
    let xy = graph.node("Add", &[&squares[0], &squares[1]]);
    let length = graph.node("Add", &[&xy, &squares[2]]);
    let length = graph.node("Sqrt", &[&length]);
    let unit = graph.node("Div", &[vectors, &length]);
    graph.columns(&unit, 3)
}

/// Values by their names in the common notation.
struct Values<'a> {
    graph: &'a mut Graph,
    known: Vec<(&'static str, Value)>,
}

impl Values<'_> {
    /// The inputs of a network, shape (rows, inputs).
    fn features(&mut self, features: Features) -> Result<Value, ExportError> {
        let expressions: Vec<&str> = features
            .inputs()
            .iter()
            .map(|name| inputs::expression(name))
            .collect::<Result<_, _>>()?;
        for (name, expression) in inputs::needed(inputs::LOCALS, &expressions) {
            let value = self.of(expression)?;
            self.known.push((name, value));
        }
        let mut columns = Vec::new();
        for expression in expressions {
            columns.push(self.of(expression)?);
        }
        if let (Features::Anisotropic { .. }, [.., across, along]) = (features, &mut columns[..]) {
            // From a grain along x to the surface's.
            let (sin, cos) = (2.0 * features.azimuth()).sin_cos();
            let turned = (
                self.combined((cos, across), (sin, along)),
                self.combined((cos, along), (-sin, across)),
            );
            (*across, *along) = turned;
        }
        Ok(self.graph.concatenate(&columns.iter().collect::<Vec<_>>()))
    }

    fn combined(&mut self, (a, x): (f64, &Value), (b, y): (f64, &Value)) -> Value {
        let (a, b) = (self.graph.row(&[a]), self.graph.row(&[b]));
        let (x, y) = (
            self.graph.node("Mul", &[x, &a]),
            self.graph.node("Mul", &[y, &b]),
        );
        self.graph.node("Add", &[&x, &y])
    }

    fn of(&mut self, expression: &str) -> Result<Value, ExportError> {
        self.evaluated(&Expression::parse(expression)?)
    }

    fn evaluated(&mut self, expression: &Expression) -> Result<Value, ExportError> {
        Ok(match expression {
            Expression::Number(number) => self.graph.row(&[*number]),
            Expression::Name(name) => {
                let known = self.known.iter().find(|(known, _)| known == name);
                let (_, value) = known.ok_or_else(|| ExportError::Input { name: name.clone() })?;
                value.clone()
            }
            Expression::Operation(operator, left, right) => {
                let (left, right) = (self.evaluated(left)?, self.evaluated(right)?);
                let operator = match operator {
                    Operator::Add => "Add",
                    Operator::Subtract => "Sub",
                    Operator::Multiply => "Mul",
                    Operator::Divide => "Div",
                };
                self.graph.node(operator, &[&left, &right])
            }
            Expression::Call(function, arguments) => {
                let mut values = Vec::new();
                for argument in arguments {
                    values.push(self.evaluated(argument)?);
                }
                match (function, values.as_slice()) {
                    (Function::Angle, [y, x]) => angle(self.graph, y, x),
                    (Function::Sqrt, [x]) => self.graph.node("Sqrt", &[x]),
                    (Function::Max, [a, b]) => self.graph.node("Max", &[a, b]),
                    _ => {
                        let name = format!("{function:?} of {} arguments", values.len());
                        return Err(ExportError::Input { name });
                    }
                }
            }
        })
    }
}

/// The arc tangent of y / x, neither negative and one not 0. Runtimes have it in single precision alone; one
/// step of Newton's method, whose error is a third power, makes it double.
fn angle(graph: &mut Graph, y: &Value, x: &Value) -> Value {
    let ratio = graph.node("Div", &[y, x]);
    let single = graph.cast(&ratio, Precision::Single);
    let first = graph.node("Atan", &[&single]);
    let first = graph.cast(&first, Precision::Double);
    let (sin, cos) = (graph.node("Sin", &[&first]), graph.node("Cos", &[&first]));
    let (yc, xs) = (graph.node("Mul", &[y, &cos]), graph.node("Mul", &[x, &sin]));
    let (xx, yy) = (graph.node("Mul", &[x, x]), graph.node("Mul", &[y, y]));
    let mut length = graph.node("Add", &[&xx, &yy]);
    length = graph.node("Sqrt", &[&length]);
    let mut rest = graph.node("Sub", &[&yc, &xs]);
    rest = graph.node("Div", &[&rest, &length]);
    graph.node("Add", &[&first, &rest])
}

/// BRDF values for predicted targets, shape (rows, channels).
fn values_of(graph: &mut Graph, transform: &FittedTransform, targets: &Value) -> Value {
    let mut targets = targets.clone();
    if let Some(basis) = transform.basis() {
        let (axes, mean) = (graph.matrix(basis.axes()), basis.mean().to_vec());
        let mean = graph.row(&mean);
        targets = graph.node("MatMul", &[&targets, &axes]);
        targets = graph.node("Add", &[&targets, &mean]);
    }
    let mut values = of_channels(graph, transform.by_channel(), &targets);
    if let Some(color) = transform.color() {
        let weights = Array2::from_shape_fn((color.len(), 3), |(k, c)| color[k][c]);
        let weights = graph.matrix(&weights);
        values = graph.node("MatMul", &[&values, &weights]);
        let zero = graph.row(&[0.0]);
        values = graph.node("Max", &[&values, &zero]);
    }
    values
}

/// The inverse of each channel's transform.
fn of_channels(graph: &mut Graph, channels: &[Channel], targets: &Value) -> Value {
    let is_mixed = |pair: &[Channel]| discriminant(&pair[0]) != discriminant(&pair[1]);
    if channels.windows(2).any(is_mixed) {
        let columns = graph.columns(targets, channels.len());
        let columns: Vec<Value> = channels
            .iter()
            .zip(&columns)
            .map(|(channel, column)| of_channels(graph, &[*channel], column))
            .collect();
        return graph.concatenate(&columns.iter().collect::<Vec<_>>());
    }
    let mut ceilings = Vec::new();
    let mut offsets = Vec::new();
    for channel in channels {
        match *channel {
            Channel::Identity => return targets.clone(),
            Channel::Log { offset, ceiling } => {
                offsets.push(offset);
                ceilings.push(ceiling);
            }
            Channel::CubeRoot { ceiling } => ceilings.push(ceiling),
        }
    }
    let values = if offsets.is_empty() {
        let square = graph.node("Mul", &[targets, targets]);
        graph.node("Mul", &[&square, targets])
    } else {
        let (one, offsets) = (graph.row(&[1.0]), graph.row(&offsets));
        let power = graph.node("Exp", &[targets]);
        let less = graph.node("Sub", &[&power, &one]);
        graph.node("Mul", &[&less, &offsets])
    };
    let (zero, ceilings) = (graph.row(&[0.0]), graph.row(&ceilings));
    let values = graph.node("Max", &[&values, &zero]);
    graph.node("Min", &[&values, &ceilings])
}
