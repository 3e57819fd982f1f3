//! Exports say what the model says: C compiled and run, GLSL in WebGL2 and WGSL in WebGPU of a
//! headless browser, HLSL by way of SPIR-V and WGSL, MERL tables by this project's own reader.
//!
//! Tests that need a compiler or a browser are ignored unless asked for (`cargo xtask test
//! --browser`). Shaders are at least parsed and validated everywhere.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "support/browser.rs"]
mod browser;

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};

use elm::advanced::NeuronBlock;

use elm::{Activation, Biases, ElmParams, NeuronGroup, solve::Ridge};
use elm_brdf::export::{ExportError, Format, Language, merl, source};
use elm_brdf::features::Features;
use elm_brdf::fit::Fit;
use elm_brdf::link::Link;
use elm_brdf::model::{BrdfModel, BrdfParams};
use elm_brdf::recipes;
use elm_datasets::Brdf;
use elm_datasets::brdf::EvalError;
use elm_datasets::geometry::{DirectionPair, cartesian};
use elm_datasets::merl::{Merl, cell};
use elm_datasets::{Invalid, MaterialId, Samples, synthetic};
use elm_test_support::{chromium, program};
use ndarray::ArrayViewMut2;
use ndarray::s;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

fn samples(material: usize) -> Samples {
    let id = MaterialId::new(material).unwrap();
    let data = synthetic::measurements(1, &[id], Invalid::Clamp);
    data.samples(0).unwrap()
}

fn network(neurons: usize, activation: Activation<f64>) -> ElmParams<f64> {
    ElmParams::new(neurons)
        .with_activation(activation)
        .with_solver(Ridge::leave_one_out())
        .with_seed(3)
}

/// A model of everything that can be exported, each with the name of its functions.
fn models() -> Vec<(String, Box<dyn Brdf>)> {
    let mut all: Vec<(BrdfParams, usize)> = Vec::new();
    let mut add = |features, link, network, channels| {
        all.push((
            BrdfParams {
                features,
                link,
                network,
            },
            channels,
        ));
    };
    let log = Link::default_log();
    for features in Features::ALL {
        add(features, log, network(30, Activation::Sine), 3);
    }
    for activation in Activation::BUILT_IN {
        // 22 neurons leave two of the last four without one.
        add(Features::Cosines, log, network(22, activation), 3);
    }
    for link in [Link::Identity, Link::CubeRoot] {
        add(Features::Highlight, link, network(30, Activation::Tanh), 3);
    }
    add(
        Features::Cosines,
        log,
        network(9, Activation::Sigmoid).with_direct_links(true),
        1,
    );
    add(
        Features::Cosines,
        log,
        network(9, Activation::Tanh).with_standardize(false),
        1,
    );
    // Several functions in one layer, of sums and of distances.
    let mixed = network(10, Activation::Tanh)
        .with_group(NeuronGroup::new(7, Activation::Sine).with_biases(Biases::AtTrainingRows))
        .with_group(NeuronGroup::rbf(9).with_scale(0.5))
        .with_group(NeuronGroup::rbf(6).with_scale(0.2));
    add(Features::Highlight, log, mixed, 3);
    let samples = samples(7);
    let pairs = &samples.directions;
    let mut models: Vec<(String, Box<dyn Brdf>)> = all
        .into_iter()
        .enumerate()
        .map(|(index, (params, channels))| {
            let values = samples.values.slice(s![.., ..channels]);
            let model: Box<dyn Brdf> = Box::new(params.fit(pairs, values).unwrap());
            (format!("m{index}"), model)
        })
        .collect();
    let usual = recipes::network(None);
    models.push((
        "usual".to_owned(),
        usual.fit(pairs, samples.values.view()).unwrap(),
    ));
    models
}

/// Random pairs and every special one, in single precision as the exports take them.
fn directions() -> Vec<DirectionPair> {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut pairs: Vec<DirectionPair> = (0..400)
        .map(|_| {
            let mut direction = || {
                cartesian(
                    random.random_range(0.0..1.7),
                    random.random_range(-3.2..3.2),
                )
            };
            DirectionPair {
                incident: direction(),
                outgoing: direction(),
            }
        })
        .collect();
    for theta in [0.0, 1e-4, 0.3, 0.785, 1.2, 1.55, 1.57] {
        let at = |phi| cartesian(theta, phi);
        for (incident, outgoing) in [
            (at(0.4), at(0.4)),
            (at(0.4), at(0.4 + std::f64::consts::PI)),
            (at(0.0), at(1.5)),
            (at(0.0), [0.0, 0.0, 1.0]),
            ([0.0, 0.0, -1.0], at(0.0)),
        ] {
            pairs.push(DirectionPair { incident, outgoing });
        }
    }
    let single = |w: [f64; 3]| w.map(|c| f64::from(c as f32));
    for pair in &mut pairs {
        *pair = DirectionPair {
            incident: single(pair.incident),
            outgoing: single(pair.outgoing),
        };
    }
    pairs
}

/// What the export should say: the model's value, or black.
fn expected(model: &dyn Brdf, pairs: &[DirectionPair]) -> Vec<[f64; 3]> {
    let values = model.eval(pairs).unwrap();
    values
        .rows()
        .into_iter()
        .zip(pairs)
        .map(|(row, pair)| {
            if pair.is_above_horizon() {
                [0, 1, 2].map(|c: usize| row[c.min(row.len() - 1)].max(0.0))
            } else {
                [0.0; 3]
            }
        })
        .collect()
}

/// Half the distance of numbers next to 1 in single precision: the relative error of a rounding.
const EPS: f64 = 5.960_464_477_539_063e-8;

/// By how much an evaluation in single precision may be off, channel by channel: roundings
/// followed through the network to first order, each taken at its worst. `None` for a
/// discontinuous activation within reach of its step.
///
/// exp is allowed the (3 + 2 |x|) units (2 EPS each) that WGSL and Vulkan allow, so that a saturating
/// activation, which takes exp of -2|z|, is off by at most 8 EPS; inputs are a handful of
/// correctly rounded operations and the arc tangent, 16 EPS with theirs.
fn bounds(model: &BrdfModel, pairs: &[DirectionPair]) -> Vec<Option<[f64; 3]>> {
    let network = model.network();
    let hidden = network.hidden();
    let (inputs, neurons) = (network.inputs(), hidden.neurons());
    let beta = network.beta();
    let of_group = hidden.groups().iter();
    let groups: Vec<&NeuronBlock<f64>> = of_group
        .flat_map(|group| std::iter::repeat_n(group, group.neurons()))
        .collect();
    let factor = |i: usize| network.scaler().map_or(1.0, |s| s.factor()[i]);
    let mean = |i: usize| network.scaler().map_or(0.0, |s| s.mean()[i]);
    let x = model.features().compute(pairs);
    let values = model.eval(pairs).unwrap();
    (0..pairs.len())
        .map(|row| {
            let x = |i: usize| x[[row, i]];
            let input_error = |i: usize| 16.0 * EPS * (1.0 + x(i).abs());
            let outputs = beta.ncols();
            // Sums of magnitudes and of errors, by output.
            let (mut size, mut error) = (vec![0.0; outputs], vec![0.0; outputs]);
            let mut term = |k: usize, value: f64, off: f64| {
                for c in 0..outputs {
                    size[c] += (beta[[k, c]] * value).abs();
                    error[c] += beta[[k, c]].abs() * off;
                }
            };
            for (k, group) in groups.iter().enumerate() {
                let activation = group.activation();
                let (mut z, mut z_size, mut z_error) =
                    (hidden.biases()[k], hidden.biases()[k].abs(), 0.0);
                for i in 0..inputs {
                    let own = hidden.weights()[[i, k]];
                    if let Some(scales) = group.input_scales() {
                        // A distance moves by no more than what it is the length of.
                        let w = scales[i] * factor(i);
                        z += (w * (x(i) - mean(i)) - own).powi(2);
                        z_size += (w * x(i)).abs() + (w * mean(i)).abs() + own.abs();
                        z_error += w.abs() * input_error(i);
                        continue;
                    }
                    let w = own * factor(i);
                    z += w * (x(i) - mean(i));
                    z_size += (w * x(i)).abs() + (w * mean(i)).abs();
                    z_error += w.abs() * input_error(i);
                }
                if group.input_scales().is_some() {
                    z = z.sqrt();
                }
                z_error += (inputs + 3) as f64 * EPS * z_size;
                if *activation == Activation::HardLimit && z.abs() < z_error {
                    return None;
                }
                let value = activation.apply(z);
                // All are Lipschitz with constant 1 but the step, and the square, whose slope is 2z.
                // The sine reduces z first.
                let lipschitz = match activation {
                    Activation::HardLimit => 0.0,
                    Activation::SquaredRelu => z_error * (2.0 * z.abs() + z_error),
                    _ => z_error,
                };
                term(
                    k,
                    value,
                    lipschitz + EPS * (8.0 + 2.0 * z.abs() + value.abs()),
                );
            }
            for link in neurons..beta.nrows() {
                let i = link - neurons;
                let value = factor(i) * (x(i) - mean(i));
                let size = factor(i) * (x(i).abs() + mean(i).abs());
                term(link, value, factor(i) * input_error(i) + 4.0 * EPS * size);
            }
            let bound = |c: usize| {
                let c = c.min(outputs - 1);
                let t = network.intercept()[c];
                let sum = (beta.nrows() + 4) as f64 * EPS * (size[c] + t.abs());
                let t_error = error[c] + sum;
                let value = values[[row, c]];
                // The slope of the link's inverse, from its values a little to both sides: it is
                // monotonic, and the model's own target is not at hand.
                reach(model, c, value, t_error)
            };
            Some([bound(0), bound(1), bound(2)])
        })
        .collect()
}

/// How far the value may move when the target moves by `t_error`.
fn reach(model: &BrdfModel, channel: usize, value: f64, t_error: f64) -> f64 {
    let channels = model.channels();
    let link = model.link();
    let row = |value: f64| ndarray::Array2::from_elem((1, channels), value);
    let target = link.to_targets(row(value).view()).unwrap()[[0, channel]];
    let at = |t: f64| link.to_values(row(t)).unwrap()[[0, channel]];
    let reach = (at(target + t_error) - at(target)).max(at(target) - at(target - t_error));
    // The exponential and what follows it, of a value a little larger than the result.
    let scale = value.abs() + (at(target + 1.0) - at(target)).abs();
    reach + EPS * scale * (12.0 + 4.0 * target.abs())
}

/// Holds what an evaluation found against the model, and returns the largest relative error.
fn check(name: &str, model: &dyn Brdf, pairs: &[DirectionPair], found: &[[f64; 3]]) -> f64 {
    assert_eq!(found.len(), pairs.len(), "{name}");
    let expected = expected(model, pairs);
    let bounds = bounds(BrdfModel::of(model).unwrap(), pairs);
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for (row, pair) in pairs.iter().enumerate() {
        for c in 0..3 {
            let (found, expected) = (found[row][c], expected[row][c]);
            if !pair.is_above_horizon() {
                assert_eq!(found, 0.0, "{name} {pair:?}");
                continue;
            }
            let Some(bound) = bounds[row] else { continue };
            let error = (found - expected).abs();
            assert!(
                error <= bound[c],
                "{name} {pair:?}: {found} for {expected}, off by {error}, bound {}",
                bound[c]
            );
            worst = worst.max(error / (expected.abs() + 1e-3));
            compared += 1;
        }
    }
    assert!(
        compared > 3 * pairs.len() / 2,
        "{name}: {compared} compared"
    );
    worst
}

/// The sources of all models in a language.
fn sources(language: Language) -> Vec<(String, Box<dyn Brdf>, String)> {
    models()
        .into_iter()
        .map(|(name, model)| {
            let text = source(BrdfModel::of(&*model).unwrap(), language, &name).unwrap();
            (name, model, text)
        })
        .collect()
}

#[test]
#[ignore = "needs a C compiler"]
fn c_source_compiles_without_a_warning_and_agrees_with_the_model() {
    let Some(cc) = program("cc") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let models = sources(Language::C);
    let mut text = String::from("#include <stdio.h>\n");
    let mut main = String::from(
        "int main(void) {\n    float l[3], v[3], rgb[3];\n    while (scanf(\"%f %f %f %f %f %f\", l, l + 1, \
         l + 2, v, v + 1, v + 2) == 6) {\n",
    );
    for (name, _, source) in &models {
        // All in one file: their names must not collide.
        text += source;
        writeln!(
            main,
            "        {name}_eval(l, v, rgb);\n        printf(\"%.9g %.9g %.9g\\n\", (double)rgb[0], \
             (double)rgb[1], (double)rgb[2]);"
        )
        .unwrap();
    }
    text += &main;
    text += "    }\n    return 0;\n}\n";
    let (file, program) = (dir.path().join("models.c"), dir.path().join("models"));
    std::fs::write(&file, text).unwrap();
    let compiled = Command::new(cc)
        .args([
            "-std=c99",
            "-O1",
            "-Wall",
            "-Wextra",
            "-Wdouble-promotion",
            "-Wconversion",
            "-Werror",
        ])
        .args(["-pedantic", "-o"])
        .args([&program, &file])
        .arg("-lm")
        .output()
        .unwrap();
    assert!(
        compiled.status.success(),
        "{}",
        String::from_utf8_lossy(&compiled.stderr)
    );

    let pairs = directions();
    let mut run = Command::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut questions = String::new();
    for pair in &pairs {
        for c in pair.incident.iter().chain(&pair.outgoing) {
            write!(questions, "{c:e} ").unwrap();
        }
    }
    let mut stdin = run.stdin.take().unwrap();
    let feeder = std::thread::spawn(move || stdin.write_all(questions.as_bytes()));
    let output = run.wait_with_output().unwrap();
    feeder.join().unwrap().unwrap();
    let numbers: Vec<[f64; 3]> = String::from_utf8(output.stdout)
        .unwrap()
        .lines()
        .map(|line| {
            let mut numbers = line.split(' ').map(|n| n.parse().unwrap());
            [0; 3].map(|_| numbers.next().unwrap())
        })
        .collect();
    for (index, (name, model, _)) in models.iter().enumerate() {
        let found: Vec<[f64; 3]> = numbers
            .iter()
            .skip(index)
            .step_by(models.len())
            .copied()
            .collect();
        let worst = check(name, &**model, &pairs, &found);
        println!("C {name}: {worst:.1e}");
    }
}

/// Parses and validates a shader.
fn validated(module: naga::Module) -> (naga::Module, naga::valid::ModuleInfo) {
    let mut validator = naga::valid::Validator::new(
        naga::valid::ValidationFlags::all(),
        naga::valid::Capabilities::default(),
    );
    let info = validator.validate(&module).unwrap();
    (module, info)
}

#[test]
fn glsl_and_wgsl_sources_parse_and_validate() {
    let mut parser = naga::front::glsl::Frontend::default();
    let options = naga::front::glsl::Options::from(naga::ShaderStage::Fragment);
    for (name, _, text) in sources(Language::Glsl) {
        let shader = format!(
            "#version 450 core\n{text}layout(location = 0) out vec4 colour;\nvoid main() {{\n\
             colour = vec4({name}_eval(vec3(0, 0, 1), vec3(0, 0, 1)), 1.0);\n}}\n"
        );
        let module = parser.parse(&options, &shader);
        validated(module.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&shader))));
    }
    for (name, _, text) in sources(Language::Wgsl) {
        let module = naga::front::wgsl::parse_str(&text);
        validated(module.unwrap_or_else(|e| panic!("{name}: {}", e.emit_to_string(&text))));
    }
}

#[test]
#[ignore = "needs glslangValidator"]
fn glslang_takes_glsl_of_the_web_and_of_desktops() {
    let Some(glslang) = program("glslangValidator") else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    for (name, _, text) in sources(Language::Glsl) {
        for version in ["300 es", "330 core"] {
            let file = dir.path().join("shader.frag");
            let shader = format!(
                "#version {version}\n{text}out vec4 colour;\nvoid main() {{\n\
                 colour = vec4({name}_eval(vec3(0, 0, 1), vec3(0, 0, 1)), 1.0);\n}}\n"
            );
            std::fs::write(&file, shader).unwrap();
            let output = Command::new(&glslang).arg(&file).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout);
            assert!(output.status.success(), "{name}, {version}: {said}");
        }
    }
}

/// HLSL as WGSL: compiled to SPIR-V by glslang, and translated from there.
fn hlsl_as_wgsl(glslang: &Path, name: &str, text: &str) -> String {
    let dir = tempfile::tempdir().unwrap();
    let (file, binary) = (
        dir.path().join("shader.hlsl"),
        dir.path().join("shader.spv"),
    );
    let shader = format!(
        "{text}RWStructuredBuffer<float4> pairs : register(u0);\n\
         RWStructuredBuffer<float4> values : register(u1);\n\
         [numthreads(1, 1, 1)]\nvoid main(uint3 id : SV_DispatchThreadID) {{\n\
         values[id.x] = float4({name}_eval(pairs[2 * id.x].xyz, pairs[2 * id.x + 1].xyz), 1.0);\n}}\n"
    );
    std::fs::write(&file, shader).unwrap();
    let output = Command::new(glslang)
        .args(["-D", "-V", "-S", "comp", "-e", "main", "-o"])
        .args([&binary, &file])
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{name}: {said}");
    let binary = std::fs::read(&binary).unwrap();
    let module = naga::front::spv::parse_u8_slice(&binary, &naga::front::spv::Options::default());
    let (module, info) = validated(module.unwrap());
    naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty()).unwrap()
}

#[test]
#[ignore = "needs Chromium and glslangValidator"]
fn shaders_run_in_a_browser_agree_with_the_model() {
    let (Some(chromium), Some(glslang)) = (chromium(), program("glslangValidator")) else {
        return;
    };
    let pairs = directions();
    let mut jobs = Vec::new();
    for (name, _, text) in sources(Language::Glsl) {
        jobs.push(serde_json::json!({ "language": "glsl", "name": name, "text": format!(
            "#version 300 es\n{text}uniform highp sampler2D pairs;\nout highp vec4 value;\n\
             void main() {{\nint x = int(gl_FragCoord.x);\nvalue = vec4({name}_eval(\n\
             texelFetch(pairs, ivec2(x, 0), 0).xyz, texelFetch(pairs, ivec2(x, 1), 0).xyz), 1.0);\n}}\n"
        )}));
    }
    for (name, _, text) in sources(Language::Wgsl) {
        jobs.push(serde_json::json!({ "language": "wgsl", "name": name, "text": format!(
            "{text}@group(0) @binding(0) var<storage, read_write> pairs: array<vec4<f32>>;\n\
             @group(0) @binding(1) var<storage, read_write> values: array<vec4<f32>>;\n\
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3<u32>) {{\n\
             let value = {name}_eval(pairs[2u * id.x].xyz, pairs[2u * id.x + 1u].xyz);\n\
             values[id.x] = vec4<f32>(value, 1.0);\n}}\n"
        )}));
    }
    for (name, _, text) in sources(Language::Hlsl) {
        let text = hlsl_as_wgsl(&glslang, &name, &text);
        jobs.push(serde_json::json!({ "language": "hlsl", "name": name, "text": text }));
    }
    let corners: Vec<[[f64; 3]; 2]> = pairs.iter().map(|p| [p.incident, p.outgoing]).collect();
    let data = serde_json::json!({ "jobs": jobs, "pairs": corners });
    let page = include_str!("support/shaders.html").replace("DATA", &data.to_string());
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("shaders.html");
    std::fs::write(&file, page).unwrap();

    let mut found: Vec<(String, Vec<[f64; 3]>)> = Vec::new();
    for message in browser::console(&chromium, &file, "", "done") {
        match message.split_once(' ') {
            // One message a block of values.
            Some(("values", rest)) => {
                let mut words = rest.split(' ');
                let (language, name) = (words.next().unwrap(), words.next().unwrap());
                let numbers: Vec<f64> = words.map(|n| n.parse().unwrap()).collect();
                let rows = numbers.as_chunks::<3>().0;
                let label = format!("{language} {name}");
                match found.last_mut() {
                    Some((last, values)) if *last == label => values.extend(rows),
                    _ => found.push((label, rows.to_vec())),
                }
            }
            Some(("skipped", why)) => elm_test_support::skip(why),
            _ => assert_eq!(message, "done", "the page reports an error"),
        }
    }
    let mut compared = 0;
    for (name, model) in models() {
        for language in ["glsl", "wgsl", "hlsl"] {
            let label = format!("{language} {name}");
            let Some((_, values)) = found.iter().find(|(found, _)| *found == label) else {
                continue;
            };
            let worst = check(&label, &*model, &pairs, values);
            println!("{label}: {worst:.1e}");
            compared += 1;
        }
    }
    assert!(compared >= models().len(), "only {compared} shaders ran");
}

/// A formula of one channel.
struct Grey;

impl Brdf for Grey {
    fn channels(&self) -> usize {
        1
    }

    fn eval_into(
        &self,
        pairs: &[DirectionPair],
        mut values: ArrayViewMut2<'_, f64>,
    ) -> Result<(), EvalError> {
        for (value, pair) in values.iter_mut().zip(pairs) {
            *value = pair.incident[2] - 0.5;
        }
        Ok(())
    }
}

#[test]
fn merl_tables_hold_the_models_values_at_the_middle_of_every_cell() {
    let dir = tempfile::tempdir().unwrap();
    for model in [models().remove(6).1, Box::new(Grey)] {
        let path = dir.path().join("model.binary");
        merl(&*model).unwrap().write(&path).unwrap();
        let table = Merl::read(&path).unwrap();
        let mut compared = 0;
        for index in (0..90 * 90 * 180).step_by(997) {
            let Some(pair) = cell(index / 180 / 90, index / 180 % 90, index % 180) else {
                continue;
            };
            let value = model.eval(&[pair, pair.swapped()]).unwrap();
            let found = table.at(&pair);
            for c in 0..3 {
                // Both are one cell.
                let of = |row: usize| value[[row, c.min(value.ncols() - 1)]].max(0.0);
                let expected = 0.5 * of(0) + 0.5 * of(1);
                // Scaled by 1500 and back.
                let error = (found[c] - expected).abs();
                assert!(error <= 1e-14 * expected, "{found:?} {value}");
            }
            compared += 1;
        }
        assert!(compared > 500, "{compared}");
    }
}

#[test]
fn what_cannot_be_exported_is_an_error_of_its_own() {
    let samples = samples(7);
    let pairs = &samples.directions;
    let model = |network: ElmParams<f64>| {
        let params = BrdfParams {
            features: Features::Cosines,
            link: Link::default_log(),
            network,
        };
        params.fit(pairs, samples.values.view()).unwrap()
    };
    let custom = model(network(
        9,
        Activation::custom("softsign", |z: f64| z / (1.0 + z.abs())),
    ));
    let error = source(&custom, Language::C, "m").unwrap_err();
    assert_eq!(error.to_string(), "cannot export the activation 'softsign'");
    let huge = model(
        network(9, Activation::Sine)
            .with_scale(1e300)
            .with_standardize(false),
    );
    let error = source(&huge, Language::C, "m").unwrap_err();
    assert!(
        matches!(error, elm_brdf::Error::Export(ExportError::Single { .. })),
        "{error}"
    );
    let good = model(network(9, Activation::Sine));
    for name in ["", "1a", "a b", "_a", "a__b", "a_", "gl_a", "ä"] {
        let error = source(&good, Language::C, name).unwrap_err();
        assert!(
            matches!(error, elm_brdf::Error::Export(ExportError::Name { .. })),
            "{error}"
        );
    }
    assert!(Format::of(Path::new("a.glsl")).is_ok());
    assert!(Format::of(Path::new("a.png")).is_err());
}
