//! `kinetoscope plot`: numbers of a recording over time, as a picture.

use crate::{Ending, Result};
use kinetoscope::record::{RecordedTopic, Recording, Wanted};
use kinetoscope::view::plot::{Plot, Series};
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
    plot.write(out)?;
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

/// Names that differ in their brackets only are one: `position[J1, J2]`, `data[0..11]`.
fn grouped(fields: &[String]) -> Vec<String> {
    let mut groups: Vec<((&str, &str), Vec<&str>)> = Vec::new();
    for field in fields {
        let parts = field.split_once('[').and_then(|(before, rest)| Some((before, rest.rsplit_once(']')?)));
        let (key, of) = match parts {
            Some((before, (of, after))) => ((before, after), Some(of)),
            None => ((field.as_str(), ""), None),
        };
        match groups.iter_mut().find(|(known, keys)| *known == key && keys.is_empty() == of.is_none()) {
            Some((_, keys)) => keys.extend(of),
            None => groups.push((key, of.into_iter().collect())),
        }
    }
    let text = |((before, after), keys): ((&str, &str), Vec<&str>)| {
        let numbered = keys.len() > 2 && keys.iter().enumerate().all(|(k, key)| key.parse() == Ok(k));
        match &keys[..] {
            [] => before.to_string(),
            keys if numbered => format!("{before}[0..{}]{after}", keys.len() - 1),
            keys => format!("{before}[{}]{after}", keys.join(", ")),
        }
    };
    groups.into_iter().map(text).collect()
}

/// Whether a name is as a pattern says, in which `*` stands for any letters.
fn fits(pattern: &str, name: &str) -> bool {
    let mut parts = pattern.split('*');
    let Some(mut rest) = parts.next().and_then(|first| name.strip_prefix(first)) else { return false };
    let mut parts: Vec<&str> = parts.collect();
    let Some(last) = parts.pop() else { return rest.is_empty() };
    for part in parts {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stars_stand_for_anything() {
        for (pattern, name, expected) in [
            ("position[J1]", "position[J1]", true),
            ("position[J1]", "position[J12]", false),
            ("position[*]", "position[J1]", true),
            ("*[J1]", "velocity[J1]", true),
            ("pos*J*]", "position[J1]", true),
            ("*", "", true),
            ("", "x", false),
            ("a*a", "a", false),
        ] {
            assert_eq!(fits(pattern, name), expected, "{pattern} {name}");
        }
    }

    #[test]
    fn lists_are_short() {
        let fields = ["a", "p[x]", "p[y]", "d[0]", "d[1]", "d[2]", "t[l].x", "t[r].x", "t[l].y"].map(String::from);
        assert_eq!(grouped(&fields), ["a", "p[x, y]", "d[0..2]", "t[l, r].x", "t[l].y"]);
    }
}
