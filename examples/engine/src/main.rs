//! A character steered by ONNX Runtime alone: docs/engine.md in code. No code of the package runs here.
//!
//!     cargo run --release -- MODEL ROUTE OUT.html [NUMBERS.json]
//!
//! ORT_DYLIB_PATH names ONNX Runtime's library. MODEL is a model's folder.

use std::collections::HashMap;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::Instant;

use ort::session::{Session, SessionInputValue};
use ort::value::Tensor;
use serde_json::{json, Value};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Numbers and their shape, the batch first.
type Array = (Vec<i64>, Vec<f32>);
type Arrays = HashMap<String, Array>;

/// Frames to a target up to which the planner is trained; further targets have no plan.
const LONGEST_PLAN_STEPS: usize = 92;

/// One of the model's graphs. It takes its inputs by name from a table of everything known.
struct Graph {
    session: Session,
    inputs: Vec<String>,
    outputs: Vec<String>,
}

impl Graph {
    fn load(environment: &ort::environment::Environment, file: &Path) -> Result<Graph> {
        let session = Session::builder(environment)?
            .with_intra_threads(1)
            .map_err(|error| error.to_string())?
            .commit_from_file(file)?;
        let names = |outlets: &[ort::value::Outlet]| outlets.iter().map(|o| o.name().to_string()).collect();
        let (inputs, outputs) = (names(session.inputs()), names(session.outputs()));
        Ok(Graph { session, inputs, outputs })
    }

    fn run(&mut self, known: &Arrays) -> Result<Arrays> {
        let mut fed: Vec<(String, SessionInputValue)> = Vec::new();
        for name in &self.inputs {
            let (shape, numbers) = known.get(name).ok_or_else(|| format!("nothing is called {name}"))?;
            fed.push((name.clone(), Tensor::from_array((shape.clone(), numbers.clone()))?.into()));
        }
        let made = self.session.run(fed)?;
        let mut out = Arrays::new();
        for name in &self.outputs {
            let (shape, numbers) = made[name.as_str()].try_extract_tensor::<f32>()?;
            out.insert(name.clone(), (shape.to_vec(), numbers.to_vec()));
        }
        Ok(out)
    }
}

/// Puts a step's outputs back into the table, under the names of the next step's inputs.
fn carry(known: &mut Arrays, made: &Arrays, path_fed_back: bool) {
    for (name, array) in made {
        if let Some(state) = name.strip_prefix("next_") {
            if state != "path" || path_fed_back {
                known.insert(state.to_string(), array.clone());
            }
        }
    }
}

fn one(number: f32) -> Array {
    (vec![1, 1], vec![number])
}

fn zeros(shape: &[i64]) -> Array {
    let mut whole = vec![1];
    whole.extend_from_slice(shape);
    (whole, vec![0.0; shape.iter().product::<i64>() as usize])
}

fn numbers(value: &Value) -> Vec<f32> {
    match value {
        Value::Array(parts) => parts.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().unwrap_or(0.0) as f32],
    }
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.len() < 3 {
        return Err("give MODEL ROUTE OUT.html [NUMBERS.json]".into());
    }
    let folder = Path::new(&arguments[0]);
    let library = std::env::var("ORT_DYLIB_PATH").map_err(|_| "ORT_DYLIB_PATH names no ONNX Runtime library")?;
    let environment = ort::init_from(library)?.build()?;
    let load = |name: &str| Graph::load(&environment, &folder.join(format!("{name}.onnx")));
    let (mut begin, mut aim, mut step, mut pose) = (load("begin")?, load("aim")?, load("step")?, load("pose")?);
    let info: Value = serde_json::from_str(&fs::read_to_string(folder.join("model.json"))?)?;
    let mut plan = if info["planner"].is_null() { None } else { Some(load("plan")?) };
    let latent = info["planner"]["latent"].as_i64().unwrap_or(0);
    let route: Value = serde_json::from_str(&fs::read_to_string(&arguments[1])?)?;
    let styles: Vec<&str> = info["styles"].as_array().map_or(vec![], |all| all.iter().filter_map(Value::as_str).collect());
    let absolute = info["absolute"].as_bool().unwrap_or(false);
    let legs = route["legs"].as_array().ok_or("the route has no legs")?;

    // A start pose. The frame before it is not known, so the start is given twice.
    let mut known = Arrays::new();
    for name in ["start", "before"] {
        known.insert(format!("{name}_hips"), (vec![1, 3], numbers(&route["start"]["hips"])));
        known.insert(format!("{name}_quaternions"), (vec![1, 22, 4], numbers(&route["start"]["quaternions"])));
    }
    known.insert("before_known".into(), one(0.0));
    let begun = begin.run(&known)?;
    known.extend(begun);
    if !absolute {
        known.insert("path".into(), zeros(&[6, 6]));
    }
    known.insert("path_known".into(), one(if absolute { 1.0 } else { 0.0 }));

    let (mut expected, mut gone, mut bases) = (0usize, 0usize, Vec::<f32>::new());
    let (mut shown, mut rotations, mut milliseconds) = (Vec::new(), Vec::new(), Vec::new());
    for frame in 0..route["frames"].as_u64().unwrap_or(0) as usize {
        let began = Instant::now();
        // What the game requests: a target, a time and a style.
        let leg = legs.iter().rev().find(|leg| leg["frame"].as_u64().unwrap_or(0) as usize <= frame).ok_or("no leg")?;
        let since = (frame - leg["frame"].as_u64().unwrap_or(0) as usize) as f32;
        let (mut hips, drift) = (numbers(&leg["hips"]), numbers(&leg["drift"]));
        hips[0] += drift[0] * since;
        hips[2] += drift[1] * since;
        let left = (leg["arrive"].as_u64().unwrap_or(0) as usize).saturating_sub(frame).max(1);
        let mut style = vec![0.0; styles.len() + 1];
        style[styles.iter().position(|name| Some(*name) == leg["style"].as_str()).map_or(0, |at| at + 1)] = 1.0;
        let requested = [
            ("goal_hips", (vec![1, 3], hips)),
            ("goal_quaternions", (vec![1, 22, 4], numbers(&leg["quaternions"]))),
            ("style", (vec![1, style.len() as i64], style)),
        ];

        let changed = left != expected || requested.iter().any(|(name, array)| known.get(*name) != Some(array));
        let mut change = 0.0;
        if changed {
            if expected == 0 {
                change = if frame == 0 { 0.0 } else { 2.0 }; // a target was reached: its speed goes on
            } else if left > 1 {
                change = 1.0; // the pose towards the former target
                feed_base(&mut known, &bases, gone, expected);
                let former = step.run(&known)?;
                known.insert("former_hips".into(), former["next_hips"].clone());
                known.insert("former_rotations".into(), former["next_rotations"].clone());
            }
            known.extend(requested.into_iter().map(|(name, array)| (name.to_string(), array)));
            known.insert("frames".into(), one(left as f32));
            known.insert("at".into(), (vec![1, left as i64 + 1], (0..=left).map(|c| c as f32).collect()));
            let mut aimed = aim.run(&known)?;
            bases = aimed.remove("bases").ok_or("no bases")?.1;
            known.extend(aimed);
            if let (Some(plan), true) = (plan.as_mut(), left <= LONGEST_PLAN_STEPS) {
                let added = plan.run(&gap(&known, latent))?;
                bases.iter_mut().zip(&added["added"].1).for_each(|(base, more)| *base += more);
            }
            gone = 0;
        }

        feed_base(&mut known, &bases, gone, left);
        let stepped = step.run(&known)?;
        carry(&mut known, &stepped, absolute);
        known.insert("velocity_known".into(), one(1.0));
        if change != 1.0 {
            known.insert("former_hips".into(), stepped["next_hips"].clone());
            known.insert("former_rotations".into(), stepped["next_rotations"].clone());
        }
        known.insert("change".into(), one(change));
        let made = pose.run(&known)?;
        carry(&mut known, &made, false);
        (expected, gone) = (left - 1, gone + 1);

        milliseconds.push(began.elapsed().as_secs_f64() * 1e3);
        shown.push(made["shown_positions"].1.clone());
        rotations.push(made["shown_quaternions"].1.clone());
    }

    milliseconds.sort_by(f64::total_cmp);
    let (middle, longest) = (milliseconds[milliseconds.len() / 2], milliseconds[milliseconds.len() - 1]);
    let drawn = json!({
        "rate": 30, "parents": info["skeleton"]["parents"], "positions": shown,
        "targets": legs.iter().map(|leg| &leg["hips"]).collect::<Vec<_>>(),
    });
    fs::write(&arguments[2], include_str!("page.html").replace("/*MOTION*/", &drawn.to_string()))?;
    if let Some(file) = arguments.get(3) {
        fs::write(file, json!({ "positions": shown, "quaternions": rotations }).to_string())?;
    }
    println!("{}: {} frames, median {middle:.2} ms, slowest {longest:.2} ms", arguments[2], shown.len());
    Ok(())
}

/// The planner's inputs: the present pose as the start of a gap, no velocity at its target, no path, no noise.
fn gap(known: &Arrays, latent: i64) -> Arrays {
    let mut out = Arrays::new();
    for name in ["hips", "rotations", "positions", "velocities"] {
        out.insert(format!("start_{name}"), known[name].clone());
    }
    for name in ["target_hips", "target_rotations", "target_positions", "style"] {
        out.insert(name.into(), known[name].clone());
    }
    out.insert("start_known".into(), known["velocity_known"].clone());
    out.insert("target_velocities".into(), zeros(&[22, 3]));
    out.insert("target_known".into(), one(0.0));
    out.insert("steps".into(), known["frames"].clone());
    out.insert("path".into(), zeros(&[8, 4]));
    out.insert("path_known".into(), one(0.0));
    out.insert("noise".into(), zeros(&[latent]));
    out.insert("frames".into(), known["at"].clone());
    out
}

/// The rows of the base at the present frame and at the next, and the frames left.
fn feed_base(known: &mut Arrays, bases: &[f32], gone: usize, left: usize) {
    let wide = 135;
    let row = |at: usize| (vec![1, wide as i64], bases[at * wide..(at + 1) * wide].to_vec());
    known.insert("base".into(), row(gone));
    known.insert("base_next".into(), row(gone + 1));
    known.insert("frames_left".into(), one(left as f32));
}
