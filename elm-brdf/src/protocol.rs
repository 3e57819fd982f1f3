//! k-fold cross-validation of any method that fits measurements.

use elm::advanced::Stream;
use elm_datasets::{Material, MaterialId, Measurements, Samples};
use ndarray::{Array2, ArrayView2, Axis, Slice, concatenate};
use rand::seq::SliceRandom;

use crate::error::{Error, Result};
use crate::fit::Fit;
use crate::metrics::{Comparison, Metrics, Truth};
use crate::model::SideBySide;
use crate::prior::{Prior, PriorParams};
use crate::quality::{self, NoiseFloor};
use crate::streams::generator;
use elm_datasets::geometry::DirectionPair;

/// Which fold each measurement is held out in: a seeded shuffle, dealt into folds whose sizes
/// differ by at most one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Folds {
    count: usize,
    of_row: Vec<usize>,
}

impl Folds {
    /// Deals `rows` measurements into `count` folds.
    ///
    /// # Errors
    /// [`Error::Folds`] unless `count` is 2 to `rows`.
    pub fn new(rows: usize, count: usize, seed: u64) -> Result<Self> {
        if count < 2 || count > rows {
            return Err(Error::Folds { folds: count, rows });
        }
        let mut order: Vec<usize> = (0..rows).collect();
        let mut random = generator(seed, Stream::Folds);
        order.shuffle(&mut random);
        let mut of_row = vec![0; rows];
        for (place, row) in order.into_iter().enumerate() {
            of_row[row] = place % count;
        }
        Ok(Self { count, of_row })
    }

    fn check(&self, rows: usize) -> Result<()> {
        if self.of_row.len() == rows {
            return Ok(());
        }
        Err(Error::Folds {
            folds: self.count,
            rows,
        })
    }

    /// Number of folds.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The fold that a measurement is held out in.
    #[must_use]
    pub fn of_row(&self, row: usize) -> usize {
        self.of_row[row]
    }
}

/// What cross-validation found for one channel of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct Scores {
    /// Over the training rows of all folds together: each measurement counts once for every fold
    /// that trained on it.
    pub train: Metrics,
    /// Over all held-out predictions together: each measurement counts once.
    pub held_out: Metrics,
    /// The mean over folds of each fold's held-out measures.
    pub held_out_fold_mean: Metrics,
    /// As [`held_out`](Self::held_out), but for the measurements that look
    /// [saturated](quality::saturated); they were trained on all the same.
    pub held_out_unsaturated: Metrics,
    /// The measurements that look saturated: rows of the material's values.
    pub saturated: Vec<usize>,
    /// What reciprocal pairs show of the measurements' noise.
    pub noise_floor: Option<NoiseFloor>,
}

/// The scores of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct MaterialScores {
    /// The material's number; `None` for samples from a user's file.
    pub id: Option<MaterialId>,
    /// Its name.
    pub name: String,
    /// One entry per channel of the measurements.
    pub channels: Vec<Scores>,
    /// The held-out prediction of each value, in 1/sr, of the shape of the material's values.
    pub predicted: Array2<f64>,
}

/// Cross-validates `method` on every material, and calls `done` after each fit with the number of
/// fits so far and in all.
///
/// Materials measured at the same directions are fitted together, fold by fold: an extreme
/// learning machine then factorises one hidden-layer matrix per fold, however many materials
/// there are; with its inputs [scaled once](crate::model::GlobalScaling), one for all folds.
///
/// # Errors
/// Those of the method; [`Error::Folds`] when `folds` was made for another number of
/// measurements.
pub fn cross_validate(
    method: &(impl Fit + ?Sized),
    data: &Measurements,
    folds: &Folds,
    done: impl Fn(usize, usize) + Sync,
) -> Result<Vec<MaterialScores>> {
    folds.check(data.directions.len())?;
    let groups = groups(&data.materials);
    let fits = groups.len() * folds.count;
    let mut scores: Vec<Option<MaterialScores>> = vec![None; data.materials.len()];
    for (g, members) in groups.iter().enumerate() {
        let materials: Vec<&Material> = members.iter().map(|&m| &data.materials[m]).collect();
        let group = Group::new(&materials, &data.directions)?;
        let (predicted, columns) =
            group.cross_validate(method, folds, |fold| done(g * folds.count + fold, fits))?;
        let mut columns = columns.into_iter();
        let mut first = 0;
        for (&member, material) in members.iter().zip(&materials) {
            let next = first + material.values.ncols();
            scores[member] = Some(MaterialScores {
                id: Some(material.id),
                name: material.name.clone(),
                channels: columns.by_ref().take(next - first).collect(),
                predicted: predicted
                    .slice_axis(Axis(1), Slice::from(first..next))
                    .to_owned(),
            });
            first = next;
        }
    }
    Ok(scores.into_iter().flatten().collect())
}

/// Cross-validates `method` on samples of a single material, and calls `done` as
/// [`cross_validate`] does.
///
/// # Errors
/// As for [`cross_validate`].
pub fn cross_validate_samples(
    method: &(impl Fit + ?Sized),
    name: &str,
    samples: &Samples,
    folds: &Folds,
    done: impl Fn(usize, usize) + Sync,
) -> Result<MaterialScores> {
    folds.check(samples.directions.len())?;
    let rows: Vec<usize> = (0..samples.directions.len()).collect();
    let group = Group {
        rows: &rows,
        pairs: samples.directions.clone(),
        values: samples.values.clone(),
    };
    let (predicted, channels) =
        group.cross_validate(method, folds, |fold| done(fold, folds.count))?;
    Ok(MaterialScores {
        id: None,
        name: name.to_owned(),
        channels,
        predicted,
    })
}

/// Cross-validates each material of `data` with a [prior](crate::prior) from the materials of
/// `pool` but itself and other measurements of the same specimen, all measured at the same
/// directions; calls `done` with the number of materials so far and in all.
///
/// No value of the material has entered its prior; the values of the others at the directions held
/// out have. Materials of the pool that lack a direction teach nothing.
///
/// # Errors
/// As for [`cross_validate`], and those of [`PriorParams::build`] and [`Prior::without`].
pub fn cross_validate_pooled(
    params: &PriorParams,
    pool: &Measurements,
    data: &Measurements,
    folds: &Folds,
    done: impl Fn(usize, usize) + Sync,
) -> Result<Vec<MaterialScores>> {
    let whole: Vec<&Material> = pool
        .materials
        .iter()
        .filter(|material| material.rows.len() == pool.directions.len())
        .collect();
    let pairs = &pool.directions;
    let priors = (0..data.channels.len())
        .map(|channel| {
            let mut values = Array2::zeros((pairs.len(), whole.len()));
            for (mut column, material) in values.columns_mut().into_iter().zip(&whole) {
                column.assign(&material.values.column(channel));
            }
            params.build(pairs, values.view())
        })
        .collect::<Result<Vec<Prior>>>()?;
    let mut all = Vec::new();
    for material in &data.materials {
        let same = |place: &usize| whole[*place].id.specimen() == material.id.specimen();
        let same: Vec<usize> = (0..whole.len()).filter(same).collect();
        let own = priors.iter().map(|prior| prior.without(&same));
        let method = ByChannel(own.collect::<Result<_>>()?);
        let alone = Measurements {
            materials: vec![material.clone()],
            ..data.clone()
        };
        all.extend(cross_validate(&method, &alone, folds, |_, _| {})?);
        done(all.len(), data.materials.len());
    }
    Ok(all)
}

/// A prior for each channel.
struct ByChannel(Vec<Prior>);

impl Fit for ByChannel {
    type Model = SideBySide;

    fn fit(&self, pairs: &[DirectionPair], values: ArrayView2<'_, f64>) -> Result<Self::Model> {
        let columns = values.axis_chunks_iter(Axis(1), 1);
        let models = self
            .0
            .iter()
            .zip(columns)
            .map(|(prior, column)| prior.fit_judged(pairs, column, None));
        Ok(SideBySide(models.collect::<Result<_>>()?))
    }
}

/// Indices of the materials that were measured at the same directions, in order of appearance.
fn groups(materials: &[Material]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (index, material) in materials.iter().enumerate() {
        match groups
            .iter_mut()
            .find(|group| materials[group[0]].rows == material.rows)
        {
            Some(group) => group.push(index),
            None => groups.push(vec![index]),
        }
    }
    groups
}

/// Materials measured at the same directions, side by side.
struct Group<'a> {
    /// Index of each measurement in the whole rig.
    rows: &'a [usize],
    pairs: Vec<DirectionPair>,
    /// Shape (rows, channels of all materials).
    values: Array2<f64>,
}

impl<'a> Group<'a> {
    fn new(materials: &[&'a Material], directions: &[DirectionPair]) -> Result<Self> {
        let rows: &[usize] = materials.first().map_or(&[], |material| &material.rows);
        let views: Vec<_> = materials
            .iter()
            .map(|material| material.values.view())
            .collect();
        let values = concatenate(Axis(1), &views).map_err(|_| Error::Empty {
            what: "measurements",
            rows: rows.len(),
            columns: 0,
        })?;
        Ok(Self {
            rows,
            pairs: rows.iter().map(|&row| directions[row]).collect(),
            values,
        })
    }

    /// The held-out prediction of each value, and the scores of each column.
    fn cross_validate(
        &self,
        method: &(impl Fit + ?Sized),
        folds: &Folds,
        done: impl Fn(usize) + Sync,
    ) -> Result<(Array2<f64>, Vec<Scores>)> {
        let rows = self.rows.len();
        let labels: Vec<usize> = self.rows.iter().map(|&row| folds.of_row(row)).collect();
        let (pairs, values) = (&self.pairs, self.values.view());
        let fits = method.cross_fits(pairs, values, &labels, folds.count, &done)?;
        let held_out = Array2::from_shape_fn(values.dim(), |(row, column)| {
            fits[labels[row]][[row, column]]
        });
        let rows_of = |fold: usize| (0..rows).partition(|&row| labels[row] == fold);
        let split: Vec<(Vec<usize>, Vec<usize>)> = (0..folds.count).map(rows_of).collect();
        let reciprocal_pairs = quality::reciprocal_pairs(pairs);
        let scores = values
            .columns()
            .into_iter()
            .enumerate()
            .map(|(column, values)| {
                let truth = Truth::new(pairs, values.insert_axis(Axis(1)));
                let mut train = Comparison::default();
                let mut each_fold = Vec::with_capacity(fits.len());
                for (fit, (test, trained)) in fits.iter().zip(&split) {
                    let fit = truth.compare(fit.column(column).iter().copied());
                    train.extend(&fit, trained);
                    // Where invalid values are dropped a fold may hold none of a material's rows.
                    if !test.is_empty() {
                        let mut held_out = Comparison::default();
                        held_out.extend(&fit, test);
                        each_fold.push(held_out.metrics()?);
                    }
                }
                let all = truth.compare(held_out.column(column).iter().copied());
                let saturated = quality::saturated(pairs, values);
                let mut unsaturated = Comparison::default();
                let is_saturated = |row: &usize| saturated.binary_search(row).is_ok();
                let left: Vec<usize> = (0..rows).filter(|row| !is_saturated(row)).collect();
                unsaturated.extend(&all, &left);
                let all = all.metrics()?;
                Ok(Scores {
                    train: train.metrics()?,
                    held_out: all,
                    held_out_fold_mean: Metrics::mean(&each_fold).unwrap_or(all),
                    held_out_unsaturated: unsaturated.metrics()?,
                    noise_floor: NoiseFloor::of(&reciprocal_pairs, values),
                    saturated,
                })
            });
        let scores = scores.collect::<Result<_>>()?;
        Ok((held_out, scores))
    }
}
