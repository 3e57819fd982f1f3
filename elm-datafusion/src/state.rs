//! What `elm_fit` keeps of a group: its rows while they are few, then what an accumulator keeps.

use std::cmp::Ordering;
use std::ops::Range;

use elm::persist::Persist;
use elm::{Accumulator, Dataset, Elm, ElmParams};
use ndarray::{Array2, ArrayView2, Axis, s};
use serde::{Deserialize, Serialize};

use crate::sample::Sample;
use crate::settings::Settings;

/// Multiplications of a fit that are shared among threads; threads of smaller ones have groups of their own.
const MIN_SHARED: usize = 100_000_000;

/// The rows of a group so far.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct State {
    columns: usize,
    rows: u64,
    pub(crate) skipped: u64,
    /// Of each target, the least and the greatest.
    ranges: Vec<(f64, f64)>,
    held: Held,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
enum Held {
    /// Row by row.
    Rows(Vec<f64>),
    Sums(Box<Accumulator<f64>>),
}

impl Persist for State {
    const KIND: &'static str = "elm fit state";
    const SCALAR: &'static str = "f64";
    /// 100 times this layout's and the accumulator's, which is part of it.
    const VERSION: u32 = 100 + <Accumulator<f64> as Persist>::VERSION;
}

impl State {
    pub(crate) fn new(columns: usize, targets: usize) -> Self {
        Self {
            columns,
            rows: 0,
            skipped: 0,
            ranges: vec![(f64::INFINITY, f64::NEG_INFINITY); targets],
            held: Held::Rows(Vec::new()),
        }
    }

    /// Whether a state from elsewhere is of these arguments.
    pub(crate) fn fits(&self, columns: usize, targets: usize) -> bool {
        let rows = match &self.held {
            Held::Rows(values) => values.len() as u64 == self.rows.saturating_mul(columns as u64),
            Held::Sums(_) => true,
        };
        self.columns == columns && self.ranges.len() == targets && rows
    }

    pub(crate) fn size(&self, settings: &Settings) -> usize {
        size_of_val(self)
            + match &self.held {
                Held::Rows(values) => values.capacity() * size_of::<f64>(),
                // The triangle and a block of rows that wait to enter it.
                Held::Sums(_) => {
                    let columns = settings.params.neurons() + self.columns;
                    6 * columns * columns * size_of::<f64>()
                }
            }
    }

    pub(crate) fn push(
        &mut self,
        rows: ArrayView2<'_, f64>,
        settings: &Settings,
        sample: Option<&Sample>,
    ) -> Result<(), Failure> {
        for (target, range) in rows.axis_iter(Axis(1)).zip(&mut self.ranges) {
            for &value in target {
                *range = (range.0.min(value), range.1.max(value));
            }
        }
        self.rows = self.rows.saturating_add(rows.nrows() as u64);
        if let Held::Rows(values) = &mut self.held {
            if self.rows <= settings.group_rows as u64 {
                match rows.as_slice() {
                    Some(rows) => values.extend_from_slice(rows),
                    None => values.extend(rows.iter()),
                }
                return Ok(());
            }
            let values = std::mem::take(values);
            let sums = sums_of(&values, self.columns, settings, sample)?;
            self.held = Held::Sums(Box::new(sums));
        }
        if let Held::Sums(sums) = &mut self.held {
            push_into(sums, rows, settings)?;
        }
        Ok(())
    }

    pub(crate) fn merge(
        &mut self,
        other: Self,
        settings: &Settings,
        sample: Option<&Sample>,
    ) -> Result<(), Failure> {
        let skipped = self.skipped.saturating_add(other.skipped);
        self.skipped = skipped;
        match other.held {
            Held::Rows(_) if self.rows == 0 && other.rows <= settings.group_rows as u64 => {
                *self = Self { skipped, ..other };
                Ok(())
            }
            Held::Rows(values) => {
                let rows = values.len() / self.columns.max(1);
                let rows = ArrayView2::from_shape((rows, self.columns), &values);
                self.push(rows.map_err(|_| Failure::OtherState)?, settings, sample)
            }
            Held::Sums(sums) => {
                for (range, other) in self.ranges.iter_mut().zip(&other.ranges) {
                    *range = (range.0.min(other.0), range.1.max(other.1));
                }
                self.rows = self.rows.saturating_add(other.rows);
                let mine = std::mem::replace(&mut self.held, Held::Sums(sums));
                if let Held::Sums(all) = &mut self.held {
                    match mine {
                        Held::Sums(mine) => all.merge(&mine)?,
                        Held::Rows(values) => {
                            let rows = values.len() / self.columns.max(1);
                            let rows = ArrayView2::from_shape((rows, self.columns), &values);
                            let rows = rows.map_err(|_| Failure::OtherState)?;
                            push_into(all, rows, settings)?;
                        }
                    }
                }
                Ok(())
            }
        }
    }

    /// The smallest form, for a file.
    pub(crate) fn compact(&mut self) -> elm::Result<()> {
        match &mut self.held {
            Held::Rows(_) => Ok(()),
            Held::Sums(sums) => sums.compact(),
        }
    }

    pub(crate) fn fit(&self, settings: &Settings) -> Result<Elm<f64>, Failure> {
        if self.rows == 0 {
            return Err(Failure::NoRows {
                skipped: self.skipped,
            });
        }
        let constant = self.ranges.iter().position(|range| range.0 == range.1);
        if let Some(target) = constant.filter(|_| self.rows > 1) {
            let (value, rows) = (self.ranges[target].0, self.rows);
            return Err(Failure::Constant {
                target,
                value,
                rows,
            });
        }
        match &self.held {
            Held::Sums(sums) => Ok(sums.fit()?),
            Held::Rows(values) => {
                let rows = values.len() / self.columns.max(1);
                let rows = ArrayView2::from_shape((rows, self.columns), values);
                let rows = rows.map_err(|_| Failure::OtherState)?;
                let columns = settings.params.neurons().saturating_add(self.columns);
                let work = columns.saturating_mul(columns).saturating_mul(rows.nrows());
                if work < MIN_SHARED {
                    return elm::on_this_thread(|| fit_rows(rows, settings));
                }
                fit_rows(rows, settings)
            }
        }
    }
}

fn fit_rows(rows: ArrayView2<'_, f64>, settings: &Settings) -> Result<Elm<f64>, Failure> {
    // The same bits in whatever order the rows have come.
    let first = rows.column(0).into_iter().copied();
    let mut order: Vec<(f64, usize)> = first.zip(0..).collect();
    order.sort_unstable_by(|(a, one), (b, other)| {
        let rest = || {
            let pairs = rows.row(*one).into_iter().zip(rows.row(*other));
            let mut orders = pairs.map(|(one, other)| one.total_cmp(other));
            orders
                .find(|order| order.is_ne())
                .unwrap_or(Ordering::Equal)
        };
        a.total_cmp(b).then_with(rest)
    });
    let order: Vec<usize> = order.into_iter().map(|(_, row)| row).collect();
    let of = |columns: Range<usize>| -> Result<Array2<f64>, Failure> {
        let mut values = Vec::with_capacity(order.len() * columns.len());
        for &row in &order {
            values.extend(rows.slice(s![row, columns.clone()]));
        }
        let shape = (order.len(), columns.len());
        Array2::from_shape_vec(shape, values).map_err(|_| Failure::OtherState)
    };
    let (x, t) = (
        of(settings.leading()..rows.ncols())?,
        of(0..settings.targets)?,
    );
    let weight = settings.leading().saturating_sub(1);
    let weights = rows.column(weight).select(Axis(0), &order);
    let mut data = Dataset::new(&x, &t)?;
    if settings.weighted {
        data = data.with_weights(&weights)?;
    }
    Ok(settings.params.fit_dataset(&data)?)
}

fn sums_of(
    values: &[f64],
    columns: usize,
    settings: &Settings,
    sample: Option<&Sample>,
) -> Result<Accumulator<f64>, Failure> {
    let sample = sample.ok_or(Failure::NoSample {
        limit: settings.group_rows,
    })?;
    let mut sums = empty(&settings.params, sample, settings.targets)?;
    // Chebyshev's inequality, by which rows are found to be unlike, is about rows of equal weight.
    sums = sums.with_unlike_rows(settings.weighted);
    let rows = ArrayView2::from_shape((values.len() / columns.max(1), columns), values);
    push_into(&mut sums, rows.map_err(|_| Failure::OtherState)?, settings)?;
    Ok(sums)
}

/// With the means and deviations of all rows, or of those kept where more than these is needed.
fn empty(
    params: &ElmParams<f64>,
    sample: &Sample,
    targets: usize,
) -> elm::Result<Accumulator<f64>> {
    match Accumulator::with_scaler(params, sample.scaler()?, targets) {
        Err(elm::Error::Conflict { .. }) => {
            Accumulator::from_sample(params, &sample.kept_inputs(), targets)
        }
        result => result,
    }
}

fn push_into(
    sums: &mut Accumulator<f64>,
    rows: ArrayView2<'_, f64>,
    settings: &Settings,
) -> Result<(), Failure> {
    let (x, t) = parts(rows, settings);
    let weights = rows.column(settings.leading().saturating_sub(1)).to_owned();
    let mut data = Dataset::new(&x, &t)?;
    if settings.weighted {
        data = data.with_weights(&weights)?;
    }
    Ok(sums.push_dataset(&data)?)
}

/// Inputs and targets.
fn parts(rows: ArrayView2<'_, f64>, settings: &Settings) -> (Array2<f64>, Array2<f64>) {
    let x = rows.slice(s![.., settings.leading()..]).to_owned();
    let t = rows.slice(s![.., ..settings.targets]).to_owned();
    (x, t)
}

/// Why a group has no model.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error("no rows to fit ({skipped} rows with NULL were skipped)")]
    NoRows { skipped: u64 },
    #[error("target {} is constant: {value} in all {rows} rows", target + 1)]
    Constant {
        target: usize,
        value: f64,
        rows: u64,
    },
    #[error(
        "a group has more than {limit} rows, which needs a first pass: SET elm.first_pass = 'always', \
         or SET elm.group_rows to more"
    )]
    NoSample { limit: usize },
    #[error("a state of other arguments")]
    OtherState,
    #[error(transparent)]
    Elm(#[from] elm::Error),
}
