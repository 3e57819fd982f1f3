#![allow(missing_docs, clippy::all, clippy::print_stdout, clippy::unwrap_used)]
use elm_brdf::{brdf::Fit, features::Features, link::Link, protocol, reference::*, published};
use elm_datasets::{Invalid, MaterialId, curet};
fn main() {
    let ids: Vec<MaterialId> = MaterialId::all().collect();
    let data = curet::read(std::path::Path::new("../shared/curet"), &ids, Invalid::Clamp).unwrap();
    let seed = std::env::args().nth(1).map_or(1, |s| s.parse().unwrap());
    let folds = protocol::Folds::new(205, 10, seed).unwrap();
    let run = |name: String, fit: &dyn Fit| {
        let t = std::time::Instant::now();
        let s = protocol::cross_validate(fit, &data, &folds, |_, _| {}).unwrap();
        let mean = s.iter().map(|m| m.channels[0].held_out.rmse).sum::<f64>() / s.len() as f64;
        let train = s.iter().map(|m| m.channels[0].train.rmse).sum::<f64>() / s.len() as f64;
        let r: Vec<f64> = s.iter().filter_map(|m| Some((m.channels[0].held_out.rmse / published::figures(m.id, "average")?.rmse).ln())).collect();
        println!("{name:50} {mean:.4} train {train:.4} ratio {:.3} {:.2}s", (r.iter().sum::<f64>() / r.len() as f64).exp(), t.elapsed().as_secs_f64());
    };
    scratch(&run);
}
fn scratch(run: &dyn Fn(String, &dyn Fit)) {
    use elm::solve::*;
    run("laf2".into(), &Analytic::Lafortune2);
    for order in [2, 8] {
        for solver in [Solver::from(PseudoInverse::default()), Ridge::leave_one_out().into(), Ridge::gcv().into()] {
            run(format!("koenderink {order} {solver:?}"), &Koenderink { order, solver });
        }
    }
    for features in [Features::Paper, Features::Cosines, Features::HalfDiff] {
        for link in [Link::Identity, Link::Log { offset: 0.1 }] {
            for count in [1, 5, 1000] {
                run(format!("{features} {link:?} idw {count}"), &Neighbours { features, link, count});
            }
        }
    }
}
