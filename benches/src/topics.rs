//! What there is to time, by topic, over sizes: one list for the criterion benches and for the
//! table of growth.

use elm::cross_validation::{CrossValidator, assign_folds};
use elm::solve::{LeastSquares, Ridge, Solver};
use elm::{Accumulator, Activation, ElmParams, Error};
use ndarray::Array2;
use std::hint::black_box;

use crate::networks::{network, rows};

/// A part of the library whose time is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Topic {
    /// Inputs to the hidden-layer matrix.
    HiddenLayer,
    /// A whole fit of given strength, straight from the inputs.
    Fit,
    /// The default solve of a given matrix, its strength chosen by leave-one-out.
    Solve,
    /// Ten folds in closed form, the factorisation included.
    Validate,
    /// Evaluation.
    Predict,
    /// Rows taken into an accumulator.
    Accumulate,
}

/// What of a size changes while the rest stays.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Varied {
    /// Rows.
    Rows,
    /// Inputs.
    Inputs,
    /// Neurons.
    Neurons,
    /// Outputs.
    Outputs,
}

/// Numbers of everything.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Rows.
    pub rows: usize,
    /// Inputs.
    pub inputs: usize,
    /// Neurons.
    pub neurons: usize,
    /// Outputs.
    pub outputs: usize,
}

impl Shape {
    const fn new(rows: usize, inputs: usize, neurons: usize, outputs: usize) -> Self {
        Self {
            rows,
            inputs,
            neurons,
            outputs,
        }
    }

    fn with(mut self, varied: Varied, value: usize) -> Self {
        match varied {
            Varied::Rows => self.rows = value,
            Varied::Inputs => self.inputs = value,
            Varied::Neurons => self.neurons = value,
            Varied::Outputs => self.outputs = value,
        }
        self
    }
}

/// One topic over growing sizes.
#[derive(Debug, Clone, Copy)]
pub struct Series {
    /// The topic.
    pub topic: Topic,
    /// What grows.
    pub varied: Varied,
    /// Its values, rising.
    pub values: &'static [usize],
    /// The rest.
    pub base: Shape,
    /// The power of what grows that the algorithm's operations have where that term leads.
    pub order: f64,
}

impl Series {
    /// The sizes, rising.
    pub fn shapes(&self) -> impl Iterator<Item = (usize, Shape)> + '_ {
        let shape = |&value: &usize| (value, self.base.with(self.varied, value));
        self.values.iter().map(shape)
    }
}

const fn series(
    topic: Topic,
    varied: Varied,
    values: &'static [usize],
    base: Shape,
    order: f64,
) -> Series {
    Series {
        topic,
        varied,
        values,
        base,
        order,
    }
}

/// Every series. Each alone takes seconds, so that all of them are a matter of minutes.
pub const ALL: [Series; 19] = {
    use Topic::{Accumulate, Fit, HiddenLayer, Predict, Solve, Validate};
    use Varied::{Inputs, Neurons, Outputs, Rows};
    [
        series(
            HiddenLayer,
            Rows,
            &[100, 1000, 10_000, 100_000],
            Shape::new(0, 10, 200, 1),
            1.0,
        ),
        series(
            HiddenLayer,
            Neurons,
            &[16, 60, 200, 500, 2000],
            Shape::new(1000, 10, 0, 1),
            1.0,
        ),
        series(
            HiddenLayer,
            Inputs,
            &[1, 6, 20, 100],
            Shape::new(1000, 0, 200, 1),
            1.0,
        ),
        series(
            Fit,
            Rows,
            &[1000, 10_000, 100_000, 1_000_000],
            Shape::new(0, 10, 100, 1),
            1.0,
        ),
        series(
            Fit,
            Neurons,
            &[16, 60, 200, 500, 1000, 2000],
            Shape::new(4000, 10, 0, 1),
            2.0,
        ),
        series(
            Fit,
            Inputs,
            &[1, 6, 20, 100],
            Shape::new(10_000, 0, 100, 1),
            1.0,
        ),
        series(
            Fit,
            Outputs,
            &[1, 3, 16, 61, 183],
            Shape::new(2000, 6, 100, 0),
            1.0,
        ),
        series(
            Solve,
            Rows,
            &[200, 1000, 5000, 20_000],
            Shape::new(0, 10, 100, 1),
            1.0,
        ),
        series(
            Solve,
            Neurons,
            &[16, 60, 200, 500],
            Shape::new(1500, 10, 0, 1),
            2.0,
        ),
        series(
            Solve,
            Outputs,
            &[1, 16, 61, 183],
            Shape::new(500, 6, 100, 0),
            1.0,
        ),
        series(
            Validate,
            Rows,
            &[200, 1000, 4000],
            Shape::new(0, 10, 60, 1),
            1.0,
        ),
        series(
            Validate,
            Neurons,
            &[16, 60, 200],
            Shape::new(1000, 10, 0, 1),
            2.0,
        ),
        series(
            Validate,
            Outputs,
            &[1, 16, 61, 183],
            Shape::new(200, 6, 60, 0),
            1.0,
        ),
        series(
            Predict,
            Rows,
            &[100, 1000, 10_000, 100_000, 1_000_000],
            Shape::new(0, 10, 200, 1),
            1.0,
        ),
        series(
            Predict,
            Neurons,
            &[16, 60, 200, 500, 2000],
            Shape::new(1000, 10, 0, 1),
            1.0,
        ),
        series(
            Predict,
            Inputs,
            &[1, 6, 20, 100],
            Shape::new(1000, 0, 200, 1),
            1.0,
        ),
        series(
            Predict,
            Outputs,
            &[1, 3, 16, 61, 183],
            Shape::new(1000, 6, 200, 0),
            1.0,
        ),
        series(
            Accumulate,
            Rows,
            &[1000, 10_000, 100_000],
            Shape::new(0, 10, 60, 1),
            1.0,
        ),
        series(
            Accumulate,
            Neurons,
            &[16, 60, 200],
            Shape::new(5000, 10, 0, 1),
            2.0,
        ),
    ]
};

impl Topic {
    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::HiddenLayer => "hidden layer",
            Self::Fit => "fit, given strength",
            Self::Solve => "solve by leave-one-out",
            Self::Validate => "validate, 10 folds",
            Self::Predict => "predict",
            Self::Accumulate => "accumulate",
        }
    }

    /// The work of this topic at a size, ready to be timed again and again.
    ///
    /// # Errors
    /// Those of setting it up.
    pub fn work(self, shape: Shape) -> Result<Box<dyn FnMut()>, Error> {
        let Shape {
            rows: count,
            inputs,
            neurons,
            outputs,
        } = shape;
        let (x, t) = (rows::<f64>(count, inputs), rows::<f64>(count, outputs));
        let params = ElmParams::new(neurons).with_activation(Activation::Tanh);
        Ok(match self {
            Self::HiddenLayer => {
                let model = network::<f64>(inputs, neurons, outputs, Activation::Tanh)?;
                Box::new(move || drop(black_box(model.hidden_matrix(&x))))
            }
            Self::Fit => {
                let params = params.with_solver(Ridge::relative(1e-6));
                Box::new(move || drop(black_box(params.fit(&x, &t))))
            }
            Self::Solve => {
                let h = network::<f64>(inputs, neurons, outputs, Activation::Tanh)?
                    .hidden_matrix(&x)?;
                Box::new(move || {
                    let problem = LeastSquares::new(&h, &t).map(|p| p.with_intercept(true));
                    drop(black_box(problem.and_then(|p| Solver::default().solve(&p))));
                })
            }
            Self::Validate => {
                let h = network::<f64>(inputs, neurons, outputs, Activation::Tanh)?
                    .hidden_matrix(&x)?;
                let folds = assign_folds(count, 10, 1)?;
                Box::new(move || {
                    let problem = LeastSquares::new(&h, &t).map(|p| p.with_intercept(true));
                    let validator = problem.and_then(|p| CrossValidator::new(&p));
                    drop(black_box(validator.and_then(|v| v.k_fold(&folds, &[1e-6]))));
                })
            }
            Self::Predict => {
                let predictor =
                    network::<f64>(inputs, neurons, outputs, Activation::Tanh)?.predictor();
                let mut scratch = predictor.scratch();
                let mut y = Array2::zeros((count, outputs));
                Box::new(move || {
                    let _ = predictor.predict_into(black_box(&x), &mut y, &mut scratch);
                })
            }
            Self::Accumulate => {
                let params = params.with_solver(Ridge::gcv());
                let empty = Accumulator::from_sample(&params, &x, outputs)?;
                Box::new(move || {
                    let mut accumulator = empty.clone();
                    let _ = accumulator.push(black_box(&x), &t);
                    drop(black_box(accumulator));
                })
            }
        })
    }
}

impl Varied {
    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Rows => "rows",
            Self::Inputs => "inputs",
            Self::Neurons => "neurons",
            Self::Outputs => "outputs",
        }
    }
}
