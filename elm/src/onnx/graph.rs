//! A graph under construction.

use ndarray::Array2;
use prost::Message;

use super::Precision;
use super::proto::{
    Attribute, DOUBLE, Dim, FLOAT, GraphProto, INT64, Model, Node, OperatorSet, Property, Shape,
    Tensor, TensorType, Type, ValueInfo,
};
use crate::dataset::TargetDim;
use crate::error::Result;
use crate::network::Elm;
use crate::scalar::Scalar;

/// The operators' version: all that are used have had `f64` kernels in onnxruntime since it, and later
/// runtimes read it.
const OPSET: i64 = 17;
/// The version of the file format that goes with it.
const FORMAT: i64 = 8;

/// A value of a graph, a tensor; made by [`Graph`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Value(String);

/// A graph under construction, for what stands around a network: other inputs, other outputs.
///
/// Values between the inputs and the outputs are `f64`, of shape (rows, columns). Operators are those of
/// ONNX, version 17.
///
/// ```
/// use elm::{ElmParams, onnx::{Graph, Precision}};
/// use ndarray::array;
///
/// // The logarithm of the target was fitted to.
/// let (x, t) = (array![[0.0], [1.0], [2.0], [3.0]], array![1.0_f64, 2.0, 4.0, 8.0]);
/// let model = ElmParams::new(10).fit(&x, &t.ln())?;
/// let mut graph = Graph::new(Precision::Single);
/// let x = graph.input("x", 1);
/// let logarithm = graph.network(&model, &x)?;
/// let y = graph.node("Exp", &[&logarithm]);
/// graph.output("y", &y, 1);
/// assert!(graph.finish().len() > 100);
/// # Ok::<(), elm::Error>(())
/// ```
#[derive(Debug)]
pub struct Graph {
    graph: GraphProto,
    precision: Precision,
    values: usize,
    properties: Vec<Property>,
}

impl Graph {
    /// A graph with inputs and outputs of this precision, without any yet.
    #[must_use]
    pub fn new(precision: Precision) -> Self {
        let graph = GraphProto {
            name: "elm".to_owned(),
            ..GraphProto::default()
        };
        Self {
            graph,
            precision,
            values: 0,
            properties: Vec::new(),
        }
    }

    fn value(&mut self) -> Value {
        self.values += 1;
        Value(format!("v{}", self.values))
    }

    fn push(&mut self, op: &str, inputs: &[&Value], outputs: &[Value], attributes: Vec<Attribute>) {
        let names = |value: &Value| value.0.clone();
        let first = outputs.first().map(names).unwrap_or_default();
        self.graph.node.push(Node {
            input: inputs.iter().map(|value| names(value)).collect(),
            output: outputs.iter().map(names).collect(),
            name: format!("{op}_{first}"),
            op_type: op.to_owned(),
            attribute: attributes,
        });
    }

    fn with(&mut self, op: &str, inputs: &[&Value], attributes: Vec<Attribute>) -> Value {
        let value = self.value();
        self.push(op, inputs, std::slice::from_ref(&value), attributes);
        value
    }

    /// An input of the graph, of shape (rows, columns).
    pub fn input(&mut self, name: &str, columns: usize) -> Value {
        let element = element(self.precision);
        self.graph.input.push(info(name, element, Some(columns)));
        self.cast(&Value(name.to_owned()), Precision::Double)
    }

    /// The value in this precision.
    pub fn cast(&mut self, value: &Value, precision: Precision) -> Value {
        let to = integer("to", i64::from(element(precision)));
        self.with("Cast", &[value], vec![to])
    }

    /// A node with one output and without attributes.
    pub fn node(&mut self, op: &str, inputs: &[&Value]) -> Value {
        self.with(op, inputs, Vec::new())
    }

    /// A node that works along an axis.
    pub(super) fn along(
        &mut self,
        op: &str,
        inputs: &[&Value],
        axis: i64,
        keep: Option<i64>,
    ) -> Value {
        let keep = keep.map(|keep| integer("keepdims", keep));
        let attributes = [Some(integer("axis", axis)), keep].into_iter().flatten();
        self.with(op, inputs, attributes.collect())
    }

    /// The sum along axes that are then gone.
    pub(super) fn sum_without(&mut self, value: &Value, axes: &Value) -> Value {
        self.with("ReduceSum", &[value, axes], vec![integer("keepdims", 0)])
    }

    /// Columns side by side.
    pub fn concatenate(&mut self, values: &[&Value]) -> Value {
        match values {
            [one] => (*one).clone(),
            several => self.along("Concat", several, 1, None),
        }
    }

    /// Each of this many columns.
    pub fn columns(&mut self, value: &Value, columns: usize) -> Vec<Value> {
        let sizes = self.integers(&vec![1; columns]);
        let parts: Vec<Value> = (0..columns).map(|_| self.value()).collect();
        self.push("Split", &[value, &sizes], &parts, vec![integer("axis", 1)]);
        parts
    }

    /// A constant matrix.
    pub fn matrix(&mut self, values: &Array2<f64>) -> Value {
        let dims = vec![values.nrows() as i64, values.ncols() as i64];
        self.tensor(dims, values.iter().copied().collect())
    }

    /// A constant vector, which stands for a row of every matrix that it meets.
    pub fn row(&mut self, values: &[f64]) -> Value {
        self.tensor(vec![values.len() as i64], values.to_vec())
    }

    fn tensor(&mut self, dims: Vec<i64>, double_data: Vec<f64>) -> Value {
        let value = self.value();
        self.graph.initializer.push(Tensor {
            dims,
            data_type: DOUBLE,
            name: value.0.clone(),
            double_data,
            ..Tensor::default()
        });
        value
    }

    pub(super) fn integers(&mut self, values: &[i64]) -> Value {
        let value = self.value();
        self.graph.initializer.push(Tensor {
            dims: vec![values.len() as i64],
            data_type: INT64,
            name: value.0.clone(),
            int64_data: values.to_vec(),
            ..Tensor::default()
        });
        value
    }

    /// What a network predicts for these inputs, shape (rows, outputs), held to its
    /// [bounds](crate::bounds).
    ///
    /// # Errors
    /// Those of [`network`](super::network).
    pub fn network<A: Scalar, D: TargetDim>(
        &mut self,
        model: &Elm<A, D>,
        x: &Value,
    ) -> Result<Value> {
        super::predictions(self, model, x)
    }

    /// An output of the graph, of shape (rows, columns).
    pub fn output(&mut self, name: &str, value: &Value, columns: usize) {
        let element = element(self.precision);
        let to = integer("to", i64::from(element));
        self.push("Cast", &[value], &[Value(name.to_owned())], vec![to]);
        self.graph.output.push(info(name, element, Some(columns)));
    }

    /// Indices of classes as an output of the graph.
    pub(super) fn label(&mut self, name: &str, value: &Value) {
        self.push("Identity", &[value], &[Value(name.to_owned())], Vec::new());
        self.graph.output.push(info(name, INT64, None));
    }

    /// Something to say of the model, which runtimes show.
    pub fn describe(&mut self, key: &str, value: &str) {
        self.properties.push(Property {
            key: key.to_owned(),
            value: value.to_owned(),
        });
    }

    /// The file.
    #[must_use]
    pub fn finish(self) -> Vec<u8> {
        let model = Model {
            metadata_props: self.properties,
            ir_version: FORMAT,
            producer_name: "elm-learn".to_owned(),
            producer_version: env!("CARGO_PKG_VERSION").to_owned(),
            graph: Some(self.graph),
            opset_import: vec![OperatorSet {
                domain: String::new(),
                version: OPSET,
            }],
        };
        model.encode_to_vec()
    }
}

fn element(precision: Precision) -> i32 {
    match precision {
        Precision::Single => FLOAT,
        Precision::Double => DOUBLE,
    }
}

fn integer(name: &str, value: i64) -> Attribute {
    Attribute {
        name: name.to_owned(),
        i: Some(value),
        kind: 2,
    }
}

/// A value of shape (rows, columns), or of one number for each row.
fn info(name: &str, elem_type: i32, columns: Option<usize>) -> ValueInfo {
    let rows = Dim {
        value: None,
        name: Some("rows".to_owned()),
    };
    let columns = columns.map(|columns| Dim {
        value: Some(columns as i64),
        name: None,
    });
    let dim = [Some(rows), columns].into_iter().flatten().collect();
    let tensor = TensorType {
        elem_type,
        shape: Some(Shape { dim }),
    };
    ValueInfo {
        name: name.to_owned(),
        value: Some(Type {
            tensor: Some(tensor),
        }),
    }
}
