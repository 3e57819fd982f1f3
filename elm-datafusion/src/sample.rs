//! The first pass: means and deviations of all rows, and some of the rows themselves.

use std::fmt::{self, Debug};
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use datafusion::arrow::array::ArrayRef;
use datafusion::arrow::datatypes::{DataType, Field, FieldRef};
use datafusion::error::Result;
use datafusion::logical_expr::expr::AggregateFunction;
use datafusion::logical_expr::function::{
    AccumulatorArgs, AggregateFunctionSimplification, StateFieldsArgs,
};
use datafusion::logical_expr::simplify::SimplifyContext;
use datafusion::logical_expr::utils::format_state_name;
use datafusion::logical_expr::{
    Accumulator, AggregateUDF, AggregateUDFImpl, Expr, Signature, Volatility,
};
use datafusion::scalar::ScalarValue;
use elm::persist::{self, Persist};
use elm::{Scaler, ScalerBuilder};
use ndarray::{Array2, ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::columns::{self, Nulls};
use crate::error::failed;
use crate::options::ElmOptions;

const NAME: &str = "elm_sample";

/// Rows that a sample keeps.
const KEPT: usize = 10_000;

/// What a first pass over all rows says about them: means and deviations of the inputs, and a sample of the
/// rows.
///
/// Of each row a hash is taken, and the rows of the smallest hashes are kept: a random sample without
/// repetition that is the same however rows are dealt to partitions. Rows that are equal are kept or left
/// out together.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Sample {
    /// Arguments before the inputs: targets and weight.
    leading: usize,
    weighted: bool,
    inputs: ScalerBuilder<f64>,
    rows: u64,
    skipped: u64,
    /// The largest hash that may still be among the smallest.
    most: u64,
    kept: Vec<(u64, Vec<f64>)>,
}

impl Persist for Sample {
    const KIND: &'static str = "elm sample";
    const SCALAR: &'static str = "f64";
    const VERSION: u32 = 1;
}

impl Sample {
    fn new(columns: usize, leading: usize, weighted: bool) -> elm::Result<Self> {
        Ok(Self {
            leading,
            weighted,
            inputs: ScalerBuilder::new(columns.saturating_sub(leading))?,
            rows: 0,
            skipped: 0,
            most: u64::MAX,
            kept: Vec::new(),
        })
    }

    /// Rows without NULL.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.rows
    }

    /// Rows that had a NULL.
    #[must_use]
    pub fn skipped(&self) -> u64 {
        self.skipped
    }

    /// Means and deviations of the inputs of all rows.
    ///
    /// # Errors
    /// [`elm::Error::Empty`] without rows.
    pub fn scaler(&self) -> elm::Result<Scaler<f64>> {
        self.inputs.build()
    }

    /// The rows that were kept, shape (rows, arguments).
    #[must_use]
    pub fn matrix(&self) -> Array2<f64> {
        let columns = self.leading + self.inputs.inputs();
        let mut matrix = Array2::zeros((self.kept.len(), columns));
        for ((_, row), mut target) in self.kept.iter().zip(matrix.rows_mut()) {
            for (value, target) in row.iter().zip(&mut target) {
                *target = *value;
            }
        }
        matrix
    }

    /// The inputs of the rows that were kept.
    #[must_use]
    pub fn kept_inputs(&self) -> Array2<f64> {
        self.matrix().slice(s![.., self.leading..]).to_owned()
    }

    fn push(&mut self, rows: ArrayView2<'_, f64>) -> elm::Result<()> {
        let inputs = rows.slice(s![.., self.leading..]);
        if self.weighted && self.leading > 0 {
            self.inputs
                .push_weighted(&inputs, &rows.column(self.leading - 1))?;
        } else {
            self.inputs.push(&inputs)?;
        }
        self.rows = self.rows.saturating_add(rows.nrows() as u64);
        for row in rows.axis_iter(Axis(0)) {
            let hash = row
                .iter()
                .fold(0, |hash, value| mixed(hash ^ value.to_bits()));
            if hash <= self.most {
                self.kept.push((hash, row.to_vec()));
            }
        }
        if self.kept.len() > 2 * KEPT {
            self.shrink();
        }
        Ok(())
    }

    /// The smallest first, and no more than are kept.
    fn shrink(&mut self) {
        let order = |row: &(u64, Vec<f64>), other: &(u64, Vec<f64>)| row.0.cmp(&other.0);
        self.kept.sort_unstable_by(order);
        self.kept.truncate(KEPT);
        if let Some((hash, _)) = self.kept.get(KEPT - 1) {
            self.most = *hash;
        }
    }

    fn merge(&mut self, other: Self) -> elm::Result<()> {
        self.inputs.merge(&other.inputs)?;
        self.rows = self.rows.saturating_add(other.rows);
        self.skipped = self.skipped.saturating_add(other.skipped);
        self.kept.extend(other.kept);
        self.shrink();
        Ok(())
    }
}

/// The finalizer of SplitMix64.
fn mixed(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// The aggregate `elm_sample(target, x1, ..., xn)`: a [`Sample`] as a file's bytes.
#[derive(Clone)]
pub struct ElmSample {
    signature: Signature,
    /// Leading arguments, weights, NULLs; the session's options where this is `None`.
    bound: Option<(usize, bool, Nulls)>,
}

impl ElmSample {
    pub(crate) fn unbound() -> Self {
        Self {
            signature: Signature::user_defined(Volatility::Immutable),
            bound: None,
        }
    }

    /// With this number of arguments before the inputs, the last of which may be a weight.
    #[must_use]
    pub fn new(leading: usize, weighted: bool, nulls: Nulls) -> Self {
        Self {
            bound: Some((leading, weighted, nulls)),
            ..Self::unbound()
        }
    }

    /// What it was made with.
    pub(crate) fn bound(&self) -> Option<(usize, bool, Nulls)> {
        self.bound
    }
}

impl Debug for ElmSample {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(NAME)
    }
}

impl PartialEq for ElmSample {
    fn eq(&self, other: &Self) -> bool {
        self.bound == other.bound
    }
}

impl Eq for ElmSample {}

impl Hash for ElmSample {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.bound.hash(state);
    }
}

impl AggregateUDFImpl for ElmSample {
    fn name(&self) -> &str {
        NAME
    }

    fn signature(&self) -> &Signature {
        &self.signature
    }

    fn return_type(&self, _: &[DataType]) -> Result<DataType> {
        Ok(DataType::BinaryView)
    }

    fn coerce_types(&self, types: &[DataType]) -> Result<Vec<DataType>> {
        columns::numbers(NAME, types, 1)
    }

    fn simplify(&self) -> Option<AggregateFunctionSimplification> {
        if self.bound.is_some() {
            return None;
        }
        Some(Box::new(
            |mut function: AggregateFunction, info: &SimplifyContext| {
                let settings = ElmOptions::of(info.config_options()).settings()?;
                let bound = Self::new(settings.leading(), settings.weighted, settings.nulls);
                function.func = Arc::new(AggregateUDF::from(bound));
                Ok(Expr::AggregateFunction(function))
            },
        ))
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let name = format_state_name(args.name, "sample");
        Ok(vec![Arc::new(Field::new(name, DataType::BinaryView, true))])
    }

    fn accumulator(&self, args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        let (leading, weighted, nulls) = self.bound.unwrap_or((1, false, Nulls::Skip));
        let columns = args.expr_fields.len();
        if columns <= leading {
            let reason = format!("{columns} arguments; expected {leading} and at least one input");
            return Err(failed(NAME, reason));
        }
        let sample =
            Sample::new(columns, leading, weighted).map_err(|error| failed(NAME, error))?;
        let names = columns::names(&args);
        Ok(Box::new(Sampling {
            sample,
            waiting: Vec::new(),
            nulls,
            names,
        }))
    }
}

#[derive(Debug)]
struct Sampling {
    sample: Sample,
    /// Other partitions' states: merged in the order of their bytes, for the same bits however they arrive.
    waiting: Vec<Vec<u8>>,
    nulls: Nulls,
    names: Vec<String>,
}

impl Sampling {
    fn merge_waiting(&mut self) -> Result<()> {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.sort_unstable();
        for bytes in waiting {
            let other: Sample = persist::from_bytes(&bytes).map_err(|error| failed(NAME, error))?;
            let columns = self.names.len();
            let sound = other.leading == self.sample.leading
                && other.kept.iter().all(|(_, row)| row.len() == columns);
            if !sound {
                return Err(failed(NAME, "a state of other arguments"));
            }
            self.sample
                .merge(other)
                .map_err(|error| failed(NAME, error))?;
        }
        Ok(())
    }
}

impl Accumulator for Sampling {
    fn update_batch(&mut self, values: &[ArrayRef]) -> Result<()> {
        let rows = columns::rows(NAME, &self.names, values, self.nulls)?;
        self.sample.skipped = self.sample.skipped.saturating_add(rows.skipped);
        let pushed = self.sample.push(rows.values.view());
        pushed.map_err(|error| {
            failed(
                NAME,
                columns::named(&error, &self.names, self.sample.leading),
            )
        })
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        self.merge_waiting()?;
        self.sample.shrink();
        let bytes = persist::to_bytes(&self.sample).map_err(|error| failed(NAME, error))?;
        Ok(ScalarValue::BinaryView(Some(bytes)))
    }

    fn size(&self) -> usize {
        let row = size_of::<(u64, Vec<f64>)>() + self.names.len() * size_of::<f64>();
        size_of_val(self) + self.sample.kept.capacity() * row
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        Ok(vec![self.evaluate()?])
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        self.waiting
            .extend(columns::binaries(NAME, states)?.map(<[u8]>::to_vec));
        Ok(())
    }
}
