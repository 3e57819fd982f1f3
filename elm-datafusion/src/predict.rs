//! The functions `elm_predict(model, x1, ..., xn)` and `elm_predict_all`.

use std::collections::HashMap;
use std::fmt::{self, Debug};
use std::hash::{Hash, Hasher};
use std::sync::{Arc, Mutex, PoisonError};

use datafusion::arrow::array::{
    Array, ArrayRef, AsArray, BinaryViewArray, Float64Builder, ListBuilder,
};
use datafusion::arrow::datatypes::{DataType, Field, Float64Type};
use datafusion::error::Result;
use datafusion::logical_expr::{
    ColumnarValue, ScalarFunctionArgs, ScalarUDFImpl, Signature, Volatility,
};
use datafusion::scalar::ScalarValue;
use elm::{Elm, Predictor, persist};
use ndarray::{Array2, Axis};

use crate::columns;
use crate::error::{failed, unplanned};

/// Models that are kept ready from one batch to the next.
const READY: usize = 16;

type Model = Arc<Predictor<f64>>;
/// The bytes of a model, and what they came to.
type Ready = (Vec<u8>, Model);

/// The function `elm_predict(model, x1, ..., xn)`, a number, or `elm_predict_all`, a list of one number per
/// target. The model is a constant, a column of one model, or one per row as a join gives them: rows are
/// grouped by model, so that each is decoded once per batch. NULL in, NULL out.
#[derive(Clone)]
pub struct ElmPredict {
    signature: Signature,
    all: bool,
    ready: Arc<Mutex<Vec<Ready>>>,
}

impl ElmPredict {
    /// `elm_predict`.
    #[must_use]
    pub fn one() -> Self {
        let signature = Signature::user_defined(Volatility::Immutable);
        Self {
            signature,
            all: false,
            ready: Arc::default(),
        }
    }

    /// `elm_predict_all`.
    #[must_use]
    pub fn all() -> Self {
        Self {
            all: true,
            ..Self::one()
        }
    }

    fn model(&self, bytes: &[u8]) -> Result<Model> {
        // A thread that failed has left the list whole.
        let mut ready = self.ready.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(position) = ready.iter().position(|(known, _)| known == bytes) {
            return Ok(Arc::clone(&ready[position].1));
        }
        let model: Elm<f64> =
            persist::from_bytes(bytes).map_err(|error| failed(self.name(), error))?;
        if !self.all && model.outputs() != 1 {
            let reason = format!(
                "the model has {} targets: use elm_predict_all",
                model.outputs()
            );
            return Err(failed(self.name(), reason));
        }
        let model = Arc::new(model.predictor());
        if ready.len() == READY {
            ready.remove(0);
        }
        ready.push((bytes.to_vec(), Arc::clone(&model)));
        Ok(model)
    }

    /// One row of predictions for each row, where there is a model and no NULL.
    fn predictions(
        &self,
        models: Vec<(&[u8], Vec<usize>)>,
        inputs: &[ArrayRef],
        rows: usize,
    ) -> Result<Vec<Option<Vec<f64>>>> {
        let mut numeric = Vec::with_capacity(inputs.len());
        for (number, input) in inputs.iter().enumerate() {
            let column = input.as_primitive_opt::<Float64Type>().ok_or_else(|| {
                let found = input.data_type();
                failed(
                    self.name(),
                    format!("input {} is {found}; expected Float64", number + 1),
                )
            })?;
            numeric.push(column);
        }
        let mut predictions = vec![None; rows];
        for (bytes, rows) in models {
            let model = self.model(bytes)?;
            if model.inputs() != inputs.len() {
                let (given, expected) = (inputs.len(), model.inputs());
                let reason = format!("{given} inputs; the model expects {expected}");
                return Err(failed(self.name(), reason));
            }
            let usable = |&row: &usize| {
                numeric
                    .iter()
                    .all(|column| column.is_valid(row) && column.value(row).is_finite())
            };
            let rows: Vec<usize> = rows.into_iter().filter(usable).collect();
            let mut x = Array2::zeros((rows.len(), inputs.len()));
            for (column, mut target) in numeric.iter().zip(x.columns_mut()) {
                for (&row, target) in rows.iter().zip(&mut target) {
                    *target = column.value(row);
                }
            }
            let y = model
                .predict(&x)
                .map_err(|error| failed(self.name(), error))?;
            for (row, y) in rows.into_iter().zip(y.axis_iter(Axis(0))) {
                predictions[row] = Some(y.to_vec());
            }
        }
        Ok(predictions)
    }
}

/// The rows of each model. Views that are the same bits are the same bytes; others are compared.
fn rows_of_models(models: &BinaryViewArray) -> Vec<(&[u8], Vec<usize>)> {
    let mut groups: Vec<(&[u8], Vec<usize>)> = Vec::new();
    let (mut views, mut contents) = (HashMap::new(), HashMap::new());
    for (row, view) in models.views().iter().enumerate() {
        if models.is_null(row) {
            continue;
        }
        let group = *views.entry(*view).or_insert_with(|| {
            *contents.entry(models.value(row)).or_insert_with(|| {
                groups.push((models.value(row), Vec::new()));
                groups.len() - 1
            })
        });
        groups[group].1.push(row);
    }
    groups
}

impl Debug for ElmPredict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl PartialEq for ElmPredict {
    fn eq(&self, other: &Self) -> bool {
        self.all == other.all
    }
}

impl Eq for ElmPredict {}

impl Hash for ElmPredict {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.all.hash(state);
    }
}

impl ScalarUDFImpl for ElmPredict {
    fn name(&self) -> &str {
        if self.all {
            "elm_predict_all"
        } else {
            "elm_predict"
        }
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(if self.all {
            DataType::List(Arc::new(Field::new_list_field(DataType::Float64, true)))
        } else {
            DataType::Float64
        })
    }

    fn coerce_types(&self, types: &[DataType]) -> Result<Vec<DataType>> {
        let [model, inputs @ ..] = types else {
            return Err(unplanned(
                self.name(),
                "no arguments; expected a model and inputs",
            ));
        };
        if inputs.is_empty() {
            return Err(unplanned(
                self.name(),
                "1 argument; expected a model and inputs",
            ));
        }
        use DataType::{Binary, BinaryView, LargeBinary, Null};
        if !matches!(model, Binary | BinaryView | LargeBinary | Null) {
            let reason = format!("argument 1 is {model}; expected a model (binary)");
            return Err(unplanned(self.name(), reason));
        }
        let mut expected = vec![BinaryView];
        expected.extend(columns::numbers(self.name(), inputs, 2)?);
        Ok(expected)
    }

    fn invoke_with_args(&self, args: ScalarFunctionArgs) -> Result<ColumnarValue> {
        let rows = args.number_rows;
        let Some((models, inputs)) = args.args.split_first() else {
            return Err(failed(
                self.name(),
                "no arguments; expected a model and inputs",
            ));
        };
        let no_model = || failed(self.name(), "argument 1 is no model (binary)");
        let models = match models {
            ColumnarValue::Scalar(ScalarValue::BinaryView(None)) => Vec::new(),
            // Not as an array, which would hold a copy for each row.
            ColumnarValue::Scalar(ScalarValue::BinaryView(Some(bytes))) => {
                vec![(bytes.as_slice(), (0..rows).collect())]
            }
            ColumnarValue::Scalar(_) => return Err(no_model()),
            ColumnarValue::Array(models) => {
                rows_of_models(models.as_binary_view_opt().ok_or_else(no_model)?)
            }
        };
        let inputs: Result<Vec<ArrayRef>> =
            inputs.iter().map(|input| input.to_array(rows)).collect();
        let predictions = self.predictions(models, &inputs?, rows)?;
        let result: ArrayRef = if self.all {
            let mut lists = ListBuilder::new(Float64Builder::new());
            for prediction in predictions {
                match prediction {
                    Some(values) => lists.append_value(values.into_iter().map(Some)),
                    None => lists.append_null(),
                }
            }
            Arc::new(lists.finish())
        } else {
            let mut values = Float64Builder::with_capacity(rows);
            for prediction in predictions {
                values.append_option(prediction.and_then(|values| values.first().copied()));
            }
            Arc::new(values.finish())
        };
        Ok(ColumnarValue::Array(result))
    }
}
