//! A graph under construction.

use ndarray::Array2;
use prost::Message;

use super::Precision;
use super::proto::{
    Attribute, DOUBLE, Dim, FLOAT, GraphProto, INT64, Model, Node, OperatorSet, Shape, Tensor,
    TensorType, Type, ValueInfo,
};

/// The operators' version: all that are used have had `f64` kernels in onnxruntime since it, and later
/// runtimes read it.
const OPSET: i64 = 17;
/// The version of the file format that goes with it.
const FORMAT: i64 = 8;

/// Nodes, each named by the value that it makes.
pub(super) struct Graph {
    graph: GraphProto,
    precision: Precision,
    values: usize,
}

impl Graph {
    pub(super) fn new(precision: Precision, inputs: usize) -> Self {
        let graph = GraphProto {
            name: "elm".to_owned(),
            input: vec![info("x", element(precision), Some(inputs))],
            ..GraphProto::default()
        };
        Self {
            graph,
            precision,
            values: 0,
        }
    }

    fn name(&mut self) -> String {
        self.values += 1;
        format!("v{}", self.values)
    }

    fn push(&mut self, op: &str, inputs: &[&str], output: &str, attributes: Vec<Attribute>) {
        self.graph.node.push(Node {
            input: inputs.iter().map(|&name| name.to_owned()).collect(),
            output: vec![output.to_owned()],
            name: format!("{op}_{output}"),
            op_type: op.to_owned(),
            attribute: attributes,
        });
    }

    /// The inputs in double precision.
    pub(super) fn input(&mut self) -> String {
        self.cast_to_double("x")
    }

    pub(super) fn cast_to_double(&mut self, value: &str) -> String {
        let name = self.name();
        self.push(
            "Cast",
            &[value],
            &name,
            vec![integer("to", i64::from(DOUBLE))],
        );
        name
    }

    /// A node without attributes.
    pub(super) fn node(&mut self, op: &str, inputs: &[&str]) -> String {
        let name = self.name();
        self.push(op, inputs, &name, Vec::new());
        name
    }

    /// A node that works along an axis.
    pub(super) fn along(
        &mut self,
        op: &str,
        inputs: &[&str],
        axis: i64,
        keep: Option<i64>,
    ) -> String {
        let name = self.name();
        let keep = keep.map(|keep| integer("keepdims", keep));
        let attributes = [Some(integer("axis", axis)), keep].into_iter().flatten();
        self.push(op, inputs, &name, attributes.collect());
        name
    }

    /// The sum along axes that are then gone.
    pub(super) fn sum_without(&mut self, value: &str, axes: &str) -> String {
        let name = self.name();
        self.push(
            "ReduceSum",
            &[value, axes],
            &name,
            vec![integer("keepdims", 0)],
        );
        name
    }

    pub(super) fn matrix(&mut self, values: &Array2<f64>) -> String {
        let dims = vec![values.nrows() as i64, values.ncols() as i64];
        self.tensor(dims, values.iter().copied().collect())
    }

    /// A vector, which is added to every row.
    pub(super) fn row(&mut self, values: &[f64]) -> String {
        self.tensor(vec![values.len() as i64], values.to_vec())
    }

    fn tensor(&mut self, dims: Vec<i64>, double_data: Vec<f64>) -> String {
        let name = self.name();
        self.graph.initializer.push(Tensor {
            dims,
            data_type: DOUBLE,
            name: name.clone(),
            double_data,
            ..Tensor::default()
        });
        name
    }

    pub(super) fn integers(&mut self, values: &[i64]) -> String {
        let name = self.name();
        self.graph.initializer.push(Tensor {
            dims: vec![values.len() as i64],
            data_type: INT64,
            name: name.clone(),
            int64_data: values.to_vec(),
            ..Tensor::default()
        });
        name
    }

    /// A value in double precision as an output of the graph.
    pub(super) fn output(&mut self, name: &str, value: &str, columns: usize) {
        let element = element(self.precision);
        self.push(
            "Cast",
            &[value],
            name,
            vec![integer("to", i64::from(element))],
        );
        self.graph.output.push(info(name, element, Some(columns)));
    }

    /// Indices of classes as an output of the graph.
    pub(super) fn label(&mut self, name: &str, value: &str) {
        self.push("Identity", &[value], name, Vec::new());
        self.graph.output.push(info(name, INT64, None));
    }

    pub(super) fn finish(self) -> Vec<u8> {
        let model = Model {
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
