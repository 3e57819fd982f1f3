//! Draws the random layer from a seed.

use ndarray::{Array1, Array2, ArrayRef2, ArrayView1, ArrayView2, s};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{StandardNormal, StandardUniform};

use super::layer::{HiddenLayer, NeuronBlock};
use super::neurons::{Biases, Distribution, NeuronGroup, NodeType};
use super::params::FeatureMapParams;
use super::ramps::{Embedding, Ramps};
use super::scaler::Scaler;
use super::{FeatureMap, embed};
use crate::check::{check_length, check_matrix};
use crate::error::{Error, Result};
use crate::memory::check_room;
use crate::scalar::Scalar;
use crate::stats::Sum;
use crate::stream::Stream;

/// Training inputs, standardized where they are looked at: a layer is laid on few of many rows.
#[derive(Clone, Copy)]
pub(crate) struct Inputs<'a, A: Scalar> {
    x: ArrayView2<'a, A>,
    scaler: Option<&'a Scaler<A>>,
    ramps: Option<&'a Ramps<A>>,
}

impl<'a, A: Scalar> Inputs<'a, A> {
    pub(super) fn new(
        x: ArrayView2<'a, A>,
        scaler: Option<&'a Scaler<A>>,
        ramps: Option<&'a Ramps<A>>,
    ) -> Self {
        Self { x, scaler, ramps }
    }

    pub(super) fn nrows(&self) -> usize {
        self.x.nrows()
    }

    pub(super) fn ncols(&self) -> usize {
        self.x.ncols() + self.ramps.map_or(0, Ramps::columns)
    }

    fn row(&self, row: usize) -> Array1<A> {
        let row = self.x.slice(s![row..=row, ..]);
        embed(self.scaler, self.ramps, row).row(0).to_owned()
    }

    /// Of each column the input that it is made of.
    fn sources(&self) -> Vec<usize> {
        match self.ramps {
            None => (0..self.x.ncols()).collect(),
            Some(ramps) => ramps.sources().collect(),
        }
    }
}

impl<'a, A: Scalar> From<ArrayView2<'a, A>> for Inputs<'a, A> {
    fn from(x: ArrayView2<'a, A>) -> Self {
        Self::new(x, None, None)
    }
}

impl<A: Scalar> FeatureMapParams<A> {
    /// The random layer alone, for this many inputs.
    ///
    /// # Errors
    /// Those of [`check`](Self::check); [`Error::Empty`] without inputs, [`Error::Shape`] for another
    /// number of input scales, [`Error::TooLarge`]; [`Error::Conflict`] for neurons that are laid on
    /// training rows ([`Biases::AtTrainingRows`], [`NodeType::Rbf`]), as there are none.
    pub fn draw(&self, inputs: usize) -> Result<HiddenLayer<A>> {
        self.check()?;
        if self.needs_rows() {
            return Err(Error::Conflict {
                first: "neurons laid on training rows",
                second: "a layer without them",
            });
        }
        let nowhere = Array2::zeros((1, inputs));
        check_matrix("inputs", nowhere.view())?;
        let ramps = self.ramps_of(nowhere.view(), None)?;
        self.draw_layer(Inputs::new(nowhere.view(), None, ramps.as_ref()), None)
    }

    /// The map for these training rows, shape (rows, inputs): measures them and draws the layer.
    ///
    /// # Errors
    /// Those of [`draw`](Self::draw) but the last; [`Error::Empty`] and [`Error::NotFinite`] for `x`.
    pub fn draw_on(&self, x: &ArrayRef2<A>) -> Result<FeatureMap<A>> {
        self.check()?;
        check_matrix("inputs", x.view())?;
        self.draw_weighted(x.view(), None)
    }

    /// As [`draw_on`](Self::draw_on), for rows of these positive weights; all has been checked.
    pub(crate) fn draw_weighted(
        &self,
        x: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<FeatureMap<A>> {
        let scaler = self.standardize.then(|| Scaler::measure(x, weights));
        self.draw_scaled(x, scaler, weights)
    }

    /// The map for these rows, standardized by `scaler`, of these positive weights.
    pub(crate) fn draw_scaled(
        &self,
        x: ArrayView2<'_, A>,
        scaler: Option<Scaler<A>>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<FeatureMap<A>> {
        let ramps = self.ramps_of(x, weights)?;
        let inputs = Inputs::new(x, scaler.as_ref(), ramps.as_ref());
        let layer = self.draw_layer(inputs, weights)?;
        let links = self.direct_links;
        Ok(FeatureMap::of_checked(scaler, ramps, layer, links))
    }

    /// The ramps of these rows.
    fn ramps_of(
        &self,
        x: ArrayView2<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<Option<Ramps<A>>> {
        Ok(match &self.embedding {
            Embedding::Inputs => None,
            Embedding::Quantiles(bins) => Some(Ramps::of(x, weights, *bins)),
            Embedding::Ramps(ramps) => {
                ramps.check(x.ncols())?;
                Some(ramps.clone())
            }
        })
    }

    fn draw_layer(
        &self,
        x: Inputs<'_, A>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> Result<HiddenLayer<A>> {
        // A failed allocation would abort the program.
        let per_neuron = x.ncols().saturating_add(1);
        check_room("the hidden layer", per_neuron, self.neurons())?;
        let scales = self.input_scales.len();
        if scales > 0 && scales != x.x.ncols() {
            check_length("input scales", scales, x.ncols())?;
        }
        Ok(self.sample(x, weights))
    }

    /// The layer for these (standardized) training rows with these positive weights.
    pub(super) fn sample<'a>(
        &self,
        x: impl Into<Inputs<'a, A>>,
        weights: Option<ArrayView1<'_, A>>,
    ) -> HiddenLayer<A> {
        let x = x.into();
        let places = Places::new(x.nrows(), weights);
        let neurons = self.groups().map(|group| group.count).sum();
        let mut layer = HiddenLayer {
            weights: Array2::zeros((x.ncols(), neurons)),
            biases: Array1::zeros(neurons),
            groups: Vec::new(),
        };
        let mut first = 0;
        for (index, group) in (0..).zip(self.groups()) {
            let columns = first..first + group.count;
            first = columns.end;
            if columns.is_empty() {
                continue;
            }
            let (weights, biases, radial) = match group.node_type {
                NodeType::Additive => {
                    let (weights, biases) = self.projections(x, &places, group, index);
                    (weights, biases, None)
                }
                NodeType::Rbf => {
                    let mut random = Stream::Rows(index).of(self.seed);
                    let (centers, scales) = self.centers(x, &places, group, &mut random);
                    (centers, Array1::zeros(group.count), Some(scales))
                }
            };
            layer
                .weights
                .slice_mut(s![.., columns.clone()])
                .assign(&weights);
            layer.biases.slice_mut(s![columns]).assign(&biases);
            layer.groups.push(NeuronBlock {
                neurons: group.count,
                activation: group.activation.clone(),
                radial,
            });
        }
        layer
    }

    /// The scale of each column that neurons see: its own, or that of the input that it is made of.
    fn column_scales(&self, x: Inputs<'_, A>) -> Vec<f64> {
        let scales = &self.input_scales;
        if scales.len() == x.ncols() {
            return scales.clone();
        }
        let sources = x.sources().into_iter();
        let scale = |input: usize| scales.get(input).copied().unwrap_or(1.0);
        sources.map(scale).collect()
    }

    fn projections(
        &self,
        x: Inputs<'_, A>,
        places: &Places,
        group: &NeuronGroup<A>,
        index: u32,
    ) -> (Array2<A>, Array1<A>) {
        let inputs = x.ncols();
        let mut random = Stream::Weights(index).of(self.seed);
        // Of a neuron one row: its weights, its bias, and what chi-square is made of.
        let more = match self.distribution {
            Distribution::StudentT(freedom) => usize::from(freedom),
            _ => 0,
        };
        let shape = (group.count, inputs + 1 + more);
        let mut draws = Array2::from_shape_simple_fn(shape, || match self.distribution {
            Distribution::Uniform => 2.0 * random.sample::<f64, _>(StandardUniform) - 1.0,
            Distribution::Normal | Distribution::StudentT(_) => random.sample(StandardNormal),
        });
        if more > 0 {
            for mut row in draws.rows_mut() {
                let squares: f64 = row.iter().skip(inputs + 1).map(|z| z * z).sum();
                let root = (squares / more as f64).sqrt().max(f64::MIN_POSITIVE);
                row.slice_mut(s![..inputs]).mapv_inplace(|z| z / root);
            }
        }
        let scale = self.scale * group.scale;
        let column_scales = self.column_scales(x);
        // Laid out by rows, as the product reads it.
        let weights = Array2::from_shape_fn((inputs, group.count), |(input, neuron)| {
            A::from_f64(draws[[neuron, input]] * scale * column_scales[input])
        });
        let drawn = |scale: f64| draws.column(inputs).mapv(|b| A::from_f64(b * scale));
        let biases = match group.biases {
            Biases::AsWeights => drawn(scale),
            Biases::Scaled(scale) => drawn(scale),
            Biases::AtTrainingRows => {
                let mut random = Stream::Rows(index).of(self.seed);
                let rows = weights
                    .columns()
                    .into_iter()
                    .map(|column| -column.dot(&x.row(places.any(&mut random))));
                rows.collect()
            }
        };
        (weights, biases)
    }

    /// Centers in scaled inputs, shape (inputs, neurons), and the scale of each input.
    fn centers(
        &self,
        x: Inputs<'_, A>,
        places: &Places,
        group: &NeuronGroup<A>,
        random: &mut ChaCha8Rng,
    ) -> (Array2<A>, Array1<A>) {
        let own = self.scale * group.scale;
        let scales = self.column_scales(x).into_iter();
        let scales: Array1<A> = scales.map(|scale| A::from_f64(own * scale)).collect();
        let rows = places.without_repetition(group.count, random);
        let mut centers = Array2::zeros((x.ncols(), group.count));
        for (mut center, row) in centers.columns_mut().into_iter().zip(rows) {
            center.assign(&(&x.row(row) * &scales));
        }
        (centers, scales)
    }
}

/// Rows to lay neurons on, drawn in proportion to their weights.
struct Places {
    rows: usize,
    /// For weights that differ the sum of those up to and with each row, as a share of all.
    shares: Option<Vec<f64>>,
}

impl Places {
    fn new<A: Scalar>(rows: usize, weights: Option<ArrayView1<'_, A>>) -> Self {
        let differing = weights.filter(|weights| weights.iter().any(|w| *w != weights[0]));
        let shares = differing.map(|weights| {
            // Relative to the largest, so that their sum is in range.
            let largest = weights.iter().fold(0.0, |m: f64, w| m.max(w.as_f64()));
            let mut sum = Sum::default();
            let sums = weights.iter().map(|w| {
                sum.add(w.as_f64() / largest);
                sum.value()
            });
            let mut shares: Vec<f64> = sums.collect();
            shares.iter_mut().for_each(|share| *share /= sum.value());
            shares
        });
        Self { rows, shares }
    }

    /// A row.
    fn any(&self, random: &mut ChaCha8Rng) -> usize {
        match &self.shares {
            None => random.random_range(0..self.rows.max(1)),
            Some(shares) => {
                // As many random bits as an unweighted draw takes, and used alike: rows that are
                // repeated one after the other are drawn as one that weighs as much.
                let place = f64::from(random.random::<u32>()) / 2.0_f64.powi(32);
                let row = shares.partition_point(|share| *share <= place);
                row.min(self.rows.saturating_sub(1))
            }
        }
    }

    /// So many rows, none twice until all are taken. Fewer are the beginning of more.
    fn without_repetition(&self, count: usize, random: &mut ChaCha8Rng) -> Vec<usize> {
        let mut rows: Vec<usize> = (0..self.rows).collect();
        if rows.is_empty() {
            return rows;
        }
        let Some(shares) = &self.shares else {
            // A shuffle that stops half-way.
            let drawn = (0..count).map(|number| {
                let place = number % rows.len();
                let other = random.random_range(place..rows.len());
                rows.swap(place, other);
                rows[place]
            });
            return drawn.collect();
        };
        // Of exponential times with the weights for rates the shortest is drawn first (Efraimidis and
        // Spirakis, Weighted random sampling with a reservoir, Information Processing Letters 97,
        // 2006).
        let mut before = 0.0;
        let times = shares.iter().map(|&share| {
            let rate = share - before;
            before = share;
            let unit: f64 = random.random();
            -(-unit).ln_1p() / rate
        });
        let times: Vec<f64> = times.collect();
        rows.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        rows.into_iter().cycle().take(count).collect()
    }
}
