//! `kinetoscope plot`: numbers of a recording over time, as a picture.

use crate::ending::{Ending, Result};
use crate::names::{fits, grouped};
use kinetoscope::record::{RecordedTopic, Recording, Wanted};
use kinetoscope::viewer::plot::{self, Plot, Series};
use std::io::Write;
use std::path::PathBuf;

/// Numbers of a recording over time, as SVG or PNG; without --topic a list of what there is
///
/// A topic may be named by its end: joint_states is /env_0/arm/joint_states where there is one arm. Each --field is plotted of
/// each --topic, so that two topics with the same names of joints lie over each other: what was wanted, and what came.
#[derive(Debug, clap::Args)]
#[command(after_help = HELP)]
pub(crate) struct Args {
    /// A recording, .mcap or .npz
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// A topic, or the end of its name; may be repeated
    #[arg(long, value_name = "NAME")]
    topic: Vec<String>,
    /// A number of these topics, such as `position[JOINT1]`; * stands for anything; may be repeated
    #[arg(long, value_name = "NAME")]
    field: Vec<String>,
    /// The environment, where the topic does not say it [default: the first that was recorded]
    #[arg(long)]
    env: Option<usize>,
    /// The plot
    #[arg(short, long, value_name = "FILE.svg|FILE.png")]
    out: Option<PathBuf>,
    /// What stands above it [default: the topics]
    #[arg(long)]
    title: Option<String>,
    /// Pixels per row
    #[arg(long, default_value_t = 960)]
    width: usize,
    /// Rows
    #[arg(long, default_value_t = 540)]
    height: usize,
}

const HELP: &str = "\
Examples:
  kinetoscope plot run.mcap                       lists what there is
  kinetoscope plot run.mcap --topic joint_states  lists its numbers
  kinetoscope plot run.mcap --topic joint_states --field 'position[*]' --out plot.svg

Exit codes: 0 done; 1 done, with warnings; 2 refused.";

pub(crate) fn run(args: &Args) -> Result<Ending> {
    let recording = Recording::open(&args.file)?;
    let mut warned = !recording.warnings().is_empty();
    recording.warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
    let listed = if warned { Ending::Warned } else { Ending::Done };
    if args.topic.is_empty() {
        if args.out.is_some() || !args.field.is_empty() {
            return Err("--topic: say of which topic; without --out and --field all of them are listed".into());
        }
        list(&recording, &recording.topics().iter().collect::<Vec<_>>());
        return Ok(listed);
    }
    let topics: Vec<&RecordedTopic> =
        args.topic.iter().map(|name| recording.topic(name, args.env)).collect::<std::result::Result<_, _>>()?;
    if args.field.is_empty() {
        if args.out.is_some() {
            let fields: Vec<String> = topics.iter().flat_map(|topic| grouped(&topic.fields)).collect();
            return Err(format!("--field: say which numbers; there are {}", fields.join(", ")).into());
        }
        list(&recording, &topics);
        return Ok(listed);
    }
    let Some(out) = &args.out else {
        return Err("--out: say where the plot goes, to a name that ends in .svg or .png".into());
    };
    let mut wanted = Vec::new();
    for topic in &topics {
        for field in &args.field {
            let before = wanted.len();
            wanted.extend(
                topic.fields.iter().filter(|known| fits(field, known)).map(|known| Wanted::new(&topic.name, known)),
            );
            if wanted.len() == before {
                // The recording says what there is.
                wanted.push(Wanted::new(&topic.name, field));
            }
        }
    }
    let samples = recording.samples(&wanted)?;
    let names: Vec<&str> = topics.iter().map(|topic| topic.name.as_str()).collect();
    let stem = wanted.first().map_or("", |wanted| stem(&wanted.field));
    let same = wanted.iter().all(|wanted| self::stem(&wanted.field) == stem);
    let mut plot = Plot::over_time(
        args.title.clone().unwrap_or_else(|| names.join(", ")),
        if same { with_unit(stem) } else { "value".into() },
    );
    plot.size = [args.width, args.height];
    for (wanted, samples) in wanted.iter().zip(samples) {
        if samples.values.is_empty() {
            eprintln!("warning: there is no {} in any message of {}", wanted.field, wanted.topic);
            warned = true;
        }
        let name = if names.len() == 1 { wanted.field.clone() } else { format!("{} {}", wanted.topic, wanted.field) };
        plot.series.push(Series::new(name, samples.times.into_iter().zip(samples.values).map(|(t, x)| [t, x])));
    }
    plot::write(&plot, out)?;
    println!("{}: {} curves, {} points", out.display(), plot.series.len(), points(&plot));
    Ok(if warned { Ending::Warned } else { Ending::Done })
}

fn points(plot: &Plot) -> usize {
    plot.series.iter().map(|series| series.points.len()).sum()
}

/// Says what is in a recording.
fn list(recording: &Recording, topics: &[&RecordedTopic]) {
    let mut out = std::io::stdout().lock();
    // A closed pipe, as behind `| head`, is no error of ours.
    let _ = writeln!(out, "{}", recording.path().display());
    for &RecordedTopic { name, kind, count, fields } in topics {
        let _ = writeln!(out, "{name}   {kind}, {count} times");
        for field in grouped(fields) {
            let _ = writeln!(out, "    {field}");
        }
    }
}

/// What a field is without saying of what.
fn stem(field: &str) -> &str {
    field.split('[').next().unwrap_or(field)
}

fn with_unit(stem: &str) -> String {
    let unit = match stem {
        "position" => " [rad or m]",
        "velocity" => " [rad/s or m/s]",
        "effort" => " [N m or N]",
        _ => "",
    };
    format!("{stem}{unit}")
}
