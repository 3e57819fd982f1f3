//! Pruned neurons against random ones, on rows held out:
//!
//! `cargo run --release -p elm-learn --example prune`
//!
//! For each problem and number of neurons: that many drawn at random, and as many kept of 400 by
//! `fit_pruned`; both with the scale of their weights tuned by leave-one-out. Geometric means over
//! five seeds of data and layers, and how many of the five the pruned network won.

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::prune::Keep;
use elm::{Activation, Biases, Dataset, Elm, ElmParams, metrics};
use elm_datasets::toy;
use ndarray::{Array1, Array2, Axis, Ix1, array};

type Data = (Array2<f64>, Array1<f64>);

/// Training rows with noise, test rows without.
type Draw = fn(seed: u64) -> Result<(Data, Data), elm_datasets::Error>;

const SEEDS: u64 = 5;
const CANDIDATES: usize = 400;

const PROBLEMS: [(&str, Draw); 5] = [
    ("sinc", |seed| {
        Ok((
            train(toy::sinc(300, 0.1, seed)?),
            test(toy::sinc(2000, 0.0, seed + 100)?),
        ))
    }),
    ("Friedman 1", |seed| {
        Ok((
            train(toy::friedman1(1000, 1.0, seed)?),
            test(toy::friedman1(2000, 0.0, seed + 100)?),
        ))
    }),
    ("Friedman 2", |seed| {
        Ok((
            train(toy::friedman2(1000, 125.0, seed)?),
            test(toy::friedman2(2000, 0.0, seed + 100)?),
        ))
    }),
    ("Friedman 3", |seed| {
        Ok((
            train(toy::friedman3(1000, 0.1, seed)?),
            test(toy::friedman3(2000, 0.0, seed + 100)?),
        ))
    }),
    ("smooth, 4 inputs, no noise", |seed| {
        Ok((smooth(1000, seed)?, smooth(2000, seed + 100)?))
    }),
];

fn train(toy: toy::Toy) -> Data {
    (toy.inputs, toy.targets.remove_axis(Axis(1)))
}

fn test(toy: toy::Toy) -> Data {
    (toy.inputs, toy.noiseless.remove_axis(Axis(1)))
}

fn smooth(rows: usize, seed: u64) -> Result<Data, elm_datasets::Error> {
    // Inputs from 0 to 2, 3.5, 1 and 2.2.
    let x = toy::friedman2(rows, 0.0, seed)?.inputs * array![0.02, 0.002, 1.0, 0.2];
    let t = x.map_axis(Axis(1), |x| {
        x[0].sin() * (-x[1]).exp() + (2.0 * x[2] + x[3]).cos()
    });
    Ok((x, t))
}

fn rmse(model: &Elm<f64, Ix1>, (x, t): &Data) -> Result<f64, elm::Error> {
    metrics::rmse(&model.predict(x)?, t)
}

fn main() -> Result<(), Box<dyn Error>> {
    println!(
        "| problem | neurons | random | pruned | pruned over random | won |\n|---|---|---|---|---|---|"
    );
    for (name, draw) in PROBLEMS {
        let mut logs = [[0.0; 2]; 3];
        let mut won = [0; 3];
        let mut within = [0.0; 3];
        for seed in 0..SEEDS {
            let ((x, t), held_out) = draw(seed)?;
            let data = Dataset::new(&x, &t)?;
            let params = |neurons: usize| {
                let params = ElmParams::new(neurons).with_activation(Activation::Tanh);
                params.with_biases(Biases::AtTrainingRows).with_seed(seed)
            };
            let wide = params(CANDIDATES).tuner().with_budget(12).tune(&data)?;
            for (place, neurons) in [20, 40, 80].into_iter().enumerate() {
                let random = params(neurons).tuner().fit(&x, &t)?;
                let pruned = wide.params.fit_pruned(&data, Keep::Neurons(neurons))?;
                let errors = [rmse(&random, &held_out)?, rmse(&pruned.model, &held_out)?];
                won[place] += usize::from(errors[1] < errors[0]);
                for (log, error) in logs[place].iter_mut().zip(errors) {
                    *log += error.ln() / SEEDS as f64;
                }
            }
            let pruned = wide.params.fit_pruned(&data, Keep::Loss(0.05))?;
            let errors = [
                rmse(&wide.model, &held_out)?,
                rmse(&pruned.model, &held_out)?,
            ];
            within[0] += pruned.kept.len() as f64 / SEEDS as f64;
            within[1] += errors[0].ln() / SEEDS as f64;
            within[2] += errors[1].ln() / SEEDS as f64;
        }
        for (place, neurons) in [20, 40, 80].into_iter().enumerate() {
            let [random, pruned] = logs[place].map(f64::exp);
            let ratio = pruned / random;
            println!(
                "| {name} | {neurons} | {random:.2e} | {pruned:.2e} | {ratio:.2} | {} of {SEEDS} |",
                won[place]
            );
        }
        let [kept, all, pruned] = [within[0], within[1].exp(), within[2].exp()];
        println!(
            "| {name} | {kept:.0} (loss 5 %) of {CANDIDATES} | {all:.2e} (all) | {pruned:.2e} | {:.2} | |",
            pruned / all
        );
    }
    Ok(())
}
