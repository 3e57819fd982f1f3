//! Fits sin(x)/x from noisy samples and draws the fit with its 90 % band:
//!
//! `cargo run --release -p elm-learn --example sinc -- sinc.svg`

#![allow(clippy::print_stdout)]

use std::error::Error;

use elm::{Dataset, ElmParams, metrics};
use elm_datasets::toy;
use ndarray::{Array1, Axis};
use plotters::prelude::*;

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args()
        .nth(1)
        .unwrap_or_else(|| "sinc.svg".to_owned());
    let train = toy::sinc(200, 0.1, 1)?;
    let targets = train.targets.remove_axis(Axis(1));
    let data = Dataset::new(&train.inputs, &targets)?;
    let tuned = ElmParams::auto().tune(&data)?;
    let model = tuned.params.fit_uncertain(&data)?;

    let test = toy::sinc(2000, 0.0, 2)?;
    let predicted = model.model().predict(&test.inputs)?;
    let error = metrics::rmse(&predicted, &test.noiseless.remove_axis(Axis(1)))?;
    println!(
        "{} neurons, scale {:.2}",
        tuned.best.neurons, tuned.best.scale
    );
    println!("rmse against the noiseless curve: {error:.4} (noise in the samples: 0.1)");

    let x = Array1::linspace(-10.0, 10.0, 401);
    let inputs = x.clone().insert_axis(Axis(1));
    let y = model.model().predict(&inputs)?;
    let (low, high) = model.predict_interval(&inputs, 0.9)?;
    let line = |values: &Array1<f64>| -> Vec<(f64, f64)> {
        x.iter().copied().zip(values.iter().copied()).collect()
    };
    let area = SVGBackend::new(&path, (800, 420)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(28)
        .y_label_area_size(44)
        .build_cartesian_2d(-10.0..10.0, -0.6..1.3)?;
    chart
        .configure_mesh()
        .light_line_style(TRANSPARENT)
        .draw()?;
    let band: Vec<(f64, f64)> = line(&low)
        .into_iter()
        .chain(line(&high).into_iter().rev())
        .collect();
    chart.draw_series([Polygon::new(band, BLUE.mix(0.15))])?;
    chart.draw_series(LineSeries::new(line(&y), BLUE.stroke_width(2)))?;
    let samples = train
        .inputs
        .column(0)
        .to_vec()
        .into_iter()
        .zip(targets.to_vec());
    chart.draw_series(samples.map(|point| Circle::new(point, 2, BLACK.mix(0.6).filled())))?;
    area.present()?;
    println!("drawn to {path}");
    Ok(())
}
