//! Weighted sums of inputs and their ramps, from tables: along one input such a sum is straight between
//! two edges, so that it takes one value and one slope, however many ramps there are.

use pulp::{Simd, WithSimd};

use super::FeatureMap;
use super::layer::HiddenLayer;
use super::ramps::{Ramps, height};
use crate::scalar::Scalar;
use crate::simd::{Aligned, Lanes, zeros};
use ndarray::ArrayView2;

/// Panels whose sums are taken together.
const PANELS: usize = 4;

/// Where a row lies along an input: the index of a segment among those of all inputs, and how far in it.
pub(crate) type Place<A> = (usize, A);

/// The sums of all neurons, and of the direct links of all outputs after them, as functions of each input.
#[derive(Debug, Clone)]
pub(crate) struct RampTables<A: Scalar> {
    inputs: Vec<Segments<A>>,
    /// Panels of neurons; and with these panels of outputs.
    pub(crate) panels: usize,
    all_panels: usize,
    /// A line for each panel.
    biases: Aligned<A>,
    /// For each segment and panel a line of values at its beginning, and one of slopes.
    lines: Aligned<A>,
}

/// The segments of an input: below its edges, between each two, and above; one where it has no edges.
#[derive(Debug, Clone)]
struct Segments<A> {
    first: usize,
    edges: Vec<A>,
    /// What is taken from the input, and what it is multiplied by then.
    mean: A,
    factor: A,
}

impl<A: Scalar> Segments<A> {
    fn scaled(&self, x: A) -> A {
        if self.factor == A::zero() {
            A::zero()
        } else {
            (x - self.mean) * self.factor
        }
    }

    fn place(&self, x: A) -> Place<A> {
        let (Some(&lowest), Some(&highest)) = (self.edges.first(), self.edges.last()) else {
            return (self.first, self.scaled(x));
        };
        let segment = self.edges.partition_point(|edge| *edge <= x);
        let along = if segment == 0 {
            self.scaled(x) - self.scaled(lowest)
        } else if segment == self.edges.len() {
            self.scaled(x) - self.scaled(highest)
        } else {
            height(x, self.edges[segment - 1], self.edges[segment])
        };
        (self.first + segment, along)
    }

    fn count(&self) -> usize {
        self.edges.len() + usize::from(self.edges.is_empty() || self.edges.len() > 1)
    }
}

impl<A: Scalar> RampTables<A> {
    /// For a map with ramps whose neurons all take weighted sums; `places` has the index of each neuron among
    /// those of `panels` panels, `links` the direct links' output weights, shape (columns, outputs).
    pub(super) fn new(
        map: &FeatureMap<A>,
        ramps: &Ramps<A>,
        places: &[usize],
        panels: usize,
        links: ArrayView2<'_, A>,
    ) -> Self {
        let outputs = if links.nrows() > 0 { links.ncols() } else { 0 };
        let all_panels = panels + outputs.div_ceil(A::LINE);
        let mut inputs = Vec::with_capacity(ramps.inputs());
        let mut segments = 0;
        for input in 0..ramps.inputs() {
            let scaler = map.scaler();
            let own = Segments {
                first: segments,
                edges: ramps.edges(input).to_vec(),
                mean: scaler.map_or(A::zero(), |s| s.mean()[input]),
                factor: scaler.map_or(A::one(), |s| s.factor()[input]),
            };
            segments += own.count();
            inputs.push(own);
        }
        let mut tables = Self {
            inputs,
            panels,
            all_panels,
            biases: zeros(all_panels * A::LINE),
            lines: zeros(segments * all_panels * 2 * A::LINE),
        };
        let layer: &HiddenLayer<A> = map.layer();
        for ((&place, weights), &bias) in places
            .iter()
            .zip(layer.weights().columns())
            .zip(layer.biases())
        {
            tables.biases[place] = bias;
            tables.fill(place, |column| weights[column]);
        }
        for output in 0..outputs {
            let link = links.column(output);
            tables.fill(panels * A::LINE + output, |column| link[column]);
        }
        tables
    }

    /// Writes what one neuron makes of each segment, given its weight of each column of the embedding.
    fn fill(&mut self, neuron: usize, weight: impl Fn(usize) -> A) {
        let (panel, lane) = (neuron / A::LINE, neuron % A::LINE);
        let mut ramp = self.inputs.len();
        for (input, own) in self.inputs.iter().enumerate() {
            let direct = weight(input);
            let mut write = |segment: usize, value: A, slope: A| {
                let line = ((own.first + segment) * self.all_panels + panel) * 2;
                self.lines[line * A::LINE + lane] = value;
                self.lines[(line + 1) * A::LINE + lane] = slope;
            };
            let Some(&lowest) = own.edges.first() else {
                write(0, A::zero(), direct);
                continue;
            };
            let mut passed = A::zero();
            write(0, direct * own.scaled(lowest), direct);
            for (bin, pair) in own.edges.windows(2).enumerate() {
                let (begin, end) = (own.scaled(pair[0]), own.scaled(pair[1]));
                let rise = weight(ramp);
                write(
                    bin + 1,
                    direct * begin + passed,
                    direct * (end - begin) + rise,
                );
                passed += rise;
                ramp += 1;
                if bin + 2 == own.edges.len() {
                    write(bin + 2, direct * end + passed, direct);
                }
            }
        }
    }

    /// Number of inputs.
    pub(crate) fn inputs(&self) -> usize {
        self.inputs.len()
    }

    /// Panels of outputs, for direct links.
    pub(crate) fn link_panels(&self) -> usize {
        self.all_panels - self.panels
    }

    /// Where a row lies along each input.
    pub(super) fn locate(&self, x: impl Iterator<Item = A>, places: &mut [Place<A>]) {
        for ((own, x), place) in self.inputs.iter().zip(x).zip(places) {
            *place = own.place(x);
        }
    }
}

/// The weighted sums of a range of panels for one row.
pub(crate) struct ProjectRamps<'a, A: Scalar> {
    pub(crate) tables: &'a RampTables<A>,
    pub(crate) places: &'a [Place<A>],
    pub(crate) first_panel: usize,
    /// Receives a line for each panel.
    pub(crate) hidden: &'a mut [A],
}

impl<A: Scalar> WithSimd for ProjectRamps<'_, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let panels = self.hidden.len() / A::LINE;
        let mut panel = 0;
        while panel < panels {
            let together = if panel + PANELS <= panels { PANELS } else { 1 };
            if together == PANELS {
                project::<S, A, PANELS>(
                    simd,
                    self.tables,
                    self.places,
                    self.first_panel + panel,
                    &mut self.hidden[panel * A::LINE..],
                );
            } else {
                project::<S, A, 1>(
                    simd,
                    self.tables,
                    self.places,
                    self.first_panel + panel,
                    &mut self.hidden[panel * A::LINE..],
                );
            }
            panel += together;
        }
    }
}

/// `P` panels from `first` on.
#[inline(always)]
fn project<S: Simd, A: Scalar, const P: usize>(
    simd: S,
    tables: &RampTables<A>,
    places: &[Place<A>],
    first: usize,
    hidden: &mut [A],
) {
    let to = A::registers_mut::<S>(&mut hidden[..P * A::LINE]).0;
    let per_line = to.len() / P;
    let biases = A::registers::<S>(&tables.biases[first * A::LINE..][..P * A::LINE]).0;
    for lane in 0..per_line {
        let mut sums = [Lanes::<S, A>::splat(simd, A::ZERO); P];
        for (panel, sum) in sums.iter_mut().enumerate() {
            *sum = Lanes::new(simd, biases[panel * per_line + lane]);
        }
        for &(segment, along) in places {
            let line = (segment * tables.all_panels + first) * 2 * A::LINE;
            let lines = A::registers::<S>(&tables.lines[line..][..2 * P * A::LINE]).0;
            let along = Lanes::splat(simd, along);
            for (panel, sum) in sums.iter_mut().enumerate() {
                let value = Lanes::<S, A>::new(simd, lines[2 * panel * per_line + lane]);
                let slope = Lanes::<S, A>::new(simd, lines[(2 * panel + 1) * per_line + lane]);
                *sum = slope.mul_add(along, *sum + value);
            }
        }
        for (panel, sum) in sums.iter().enumerate() {
            to[panel * per_line + lane] = sum.register();
        }
    }
}
