//! The aggregate `elm_fit(target, x1, ..., xn)`.

use std::fmt::{self, Debug};
use std::hash::{Hash, Hasher};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use datafusion::arrow::array::ArrayRef;
use datafusion::arrow::datatypes::{DataType, Field, FieldRef};
use datafusion::error::{DataFusionError, Result};
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
use elm::ElmParams;
use elm::persist;

use crate::columns;
use crate::error::{failed, unplanned};
use crate::options::ElmOptions;
use crate::sample::Sample;
use crate::settings::Settings;
use crate::state::{Failure, State};

pub(crate) const NAME: &str = "elm_fit";

/// The aggregate `elm_fit(target, x1, ..., xn)`: a fitted network, as the bytes of the file that
/// [`elm::persist`] writes. Its settings are those of the session ([`ElmOptions`]), or given here.
#[derive(Clone)]
pub struct ElmFit {
    signature: Signature,
    bound: Option<Arc<Bound>>,
    rows: Arc<AtomicU64>,
}

#[derive(Debug)]
struct Bound {
    settings: Settings,
    sample: Option<Sample>,
}

impl ElmFit {
    pub(crate) fn unbound() -> Self {
        Self {
            signature: Signature::user_defined(Volatility::Immutable),
            bound: None,
            rows: Arc::default(),
        }
    }

    /// With settings of its own, and what a first pass found, which groups of many rows need.
    #[must_use]
    pub fn new(settings: Settings, sample: Option<Sample>) -> Self {
        let bound = Some(Arc::new(Bound { settings, sample }));
        Self {
            bound,
            ..Self::unbound()
        }
    }

    /// Counts the rows that have been taken in while a query runs.
    #[must_use]
    pub fn progress(&self) -> Arc<AtomicU64> {
        Arc::clone(&self.rows)
    }

    pub(crate) fn is_bound(&self) -> bool {
        self.bound.is_some()
    }

    /// What it was made with.
    pub(crate) fn bound(&self) -> Option<(Settings, Option<Sample>)> {
        let bound = self.bound.as_ref()?;
        Some((bound.settings.clone(), bound.sample.clone()))
    }
}

impl Debug for ElmFit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(NAME)
    }
}

impl PartialEq for ElmFit {
    fn eq(&self, other: &Self) -> bool {
        match (&self.bound, &other.bound) {
            (Some(one), Some(other)) => {
                let samples = one.sample.is_none() && other.sample.is_none();
                Arc::ptr_eq(one, other) || (samples && one.settings == other.settings)
            }
            (None, None) => true,
            _ => false,
        }
    }
}

impl Eq for ElmFit {}

impl Hash for ElmFit {
    fn hash<H: Hasher>(&self, state: &mut H) {
        let neurons = self
            .bound
            .as_ref()
            .map(|bound| bound.settings.params.neurons());
        (NAME, neurons).hash(state);
    }
}

impl AggregateUDFImpl for ElmFit {
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
        if types.len() < 2 {
            let reason = format!(
                "{} arguments; expected a target and at least one input",
                types.len()
            );
            return Err(unplanned(NAME, reason));
        }
        columns::numbers(NAME, types, 1)
    }

    fn simplify(&self) -> Option<AggregateFunctionSimplification> {
        if self.is_bound() {
            return None;
        }
        let rows = Arc::clone(&self.rows);
        Some(Box::new(
            move |mut function: AggregateFunction, info: &SimplifyContext| {
                let settings = ElmOptions::of(info.config_options()).settings()?;
                let bound = Self {
                    rows: Arc::clone(&rows),
                    ..Self::new(settings, None)
                };
                function.func = Arc::new(AggregateUDF::from(bound));
                Ok(Expr::AggregateFunction(function))
            },
        ))
    }

    fn state_fields(&self, args: StateFieldsArgs<'_>) -> Result<Vec<FieldRef>> {
        let name = format_state_name(args.name, "state");
        Ok(vec![Arc::new(Field::new(name, DataType::BinaryView, true))])
    }

    fn accumulator(&self, args: AccumulatorArgs<'_>) -> Result<Box<dyn Accumulator>> {
        if args.is_distinct {
            return Err(unplanned(
                NAME,
                "DISTINCT is not supported; select distinct rows first",
            ));
        }
        let bound = match &self.bound {
            Some(bound) => Arc::clone(bound),
            // A plan that no optimizer has seen.
            None => Arc::new(Bound {
                settings: Settings::new(ElmParams::new(100)),
                sample: None,
            }),
        };
        let names = columns::names(&args);
        let (columns, leading) = (names.len(), bound.settings.leading());
        if columns <= leading {
            let reason =
                format!("{columns} arguments; expected {leading} before at least one input");
            return Err(unplanned(NAME, reason));
        }
        let state = State::new(columns, bound.settings.targets);
        let rows = Arc::clone(&self.rows);
        Ok(Box::new(Fitting {
            state,
            waiting: Vec::new(),
            bound,
            names,
            rows,
        }))
    }
}

#[derive(Debug)]
struct Fitting {
    state: State,
    /// Other partitions' states: merged in the order of their bytes, for the same bits however they arrive.
    waiting: Vec<Vec<u8>>,
    bound: Arc<Bound>,
    names: Vec<String>,
    rows: Arc<AtomicU64>,
}

impl Fitting {
    fn merge_waiting(&mut self) -> Result<()> {
        let mut waiting = std::mem::take(&mut self.waiting);
        waiting.sort_unstable();
        for bytes in waiting {
            let other: State = persist::from_bytes(&bytes).map_err(|error| failed(NAME, error))?;
            let (settings, sample) = (&self.bound.settings, self.bound.sample.as_ref());
            if !other.fits(self.names.len(), settings.targets) {
                return Err(failed(NAME, Failure::OtherState));
            }
            let merged = self.state.merge(other, settings, sample);
            merged.map_err(|failure| self.failed(&failure))?;
        }
        Ok(())
    }

    fn failed(&self, failure: &Failure) -> DataFusionError {
        let leading = self.bound.settings.leading();
        match failure {
            Failure::Elm(error) => failed(NAME, columns::named(error, &self.names, leading)),
            Failure::Constant { target, .. } => failed(
                NAME,
                format!("{}: {failure}", columns::argument(*target, &self.names)),
            ),
            failure => failed(NAME, failure),
        }
    }
}

impl Accumulator for Fitting {
    fn update_batch(&mut self, values: &[ArrayRef]) -> Result<()> {
        let settings = &self.bound.settings;
        let rows = columns::rows(NAME, &self.names, values, settings.nulls)?;
        self.state.skipped = self.state.skipped.saturating_add(rows.skipped);
        let count = rows.values.nrows() as u64 + rows.skipped;
        let sample = self.bound.sample.as_ref();
        let pushed = self.state.push(rows.values.view(), settings, sample);
        pushed.map_err(|failure| self.failed(&failure))?;
        self.rows.fetch_add(count, Ordering::Relaxed);
        Ok(())
    }

    fn evaluate(&mut self) -> Result<ScalarValue> {
        self.merge_waiting()?;
        match self.state.fit(&self.bound.settings) {
            Ok(model) => {
                let bytes = persist::to_bytes(&model).map_err(|error| failed(NAME, error))?;
                Ok(ScalarValue::BinaryView(Some(bytes)))
            }
            Err(_) if self.bound.settings.null_on_failure => Ok(ScalarValue::BinaryView(None)),
            Err(failure) => Err(self.failed(&failure)),
        }
    }

    fn size(&self) -> usize {
        let waiting: usize = self.waiting.iter().map(Vec::capacity).sum();
        size_of_val(self) + waiting + self.state.size(&self.bound.settings)
    }

    fn state(&mut self) -> Result<Vec<ScalarValue>> {
        self.merge_waiting()?;
        self.state.compact().map_err(|error| failed(NAME, error))?;
        let bytes = persist::to_bytes(&self.state).map_err(|error| failed(NAME, error))?;
        Ok(vec![ScalarValue::BinaryView(Some(bytes))])
    }

    fn merge_batch(&mut self, states: &[ArrayRef]) -> Result<()> {
        self.waiting
            .extend(columns::binaries(NAME, states)?.map(<[u8]>::to_vec));
        Ok(())
    }
}
