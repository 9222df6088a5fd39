//! Meaning of mask ids: segments by instance, link and class.

use crate::camera::error::CameraError;
use crate::error::SensorError;
use crate::select::matching;
use kinetoscope_scene::pattern::{PatternError, closest_names};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// An entity with its own mask id, such as a link of a robot, a rigid object, a body of an MJCF file, a tendon or a
/// geom of the world.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SegmentedEntity {
    /// Mask id, from 1 on.
    pub id: i32,
    /// Name of the robot, of the object, of the geom of the world, or the uid of the MJCF file.
    pub object: String,
    /// Name of the link of a robot, of the body of an MJCF file or of the tendon; `None` for rigid objects and geoms of
    /// the world.
    pub link: Option<String>,
    /// Semantic class, unless a label assigns another one.
    pub class: String,
}

impl SegmentedEntity {
    /// Full name: `object/link`, or the object if it has no links.
    pub fn name(&self) -> String {
        self.link.as_ref().map_or_else(|| self.object.clone(), |link| format!("{}/{link}", self.object))
    }
}

/// Granularity of segments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum SegmentLevel {
    /// One segment per object, such as a whole robot. Its id is the smallest mask id of its links, so the id does not
    /// change when other entities are added.
    #[default]
    Instance,
    /// One segment per link, and per object without links. Ids are mask ids.
    Link,
    /// One segment per class. Ids count from 1 in the order in which the classes first appear among mask ids.
    Semantic,
}

/// Assignment of entities to classes.
///
/// ```
/// use kinetoscope_sensors::camera::{SegmentLevel, Segmentation, SegmentationCfg, SegmentedEntity};
///
/// let thing = |id, object: &str| SegmentedEntity { id, object: object.into(), link: None, class: "object".into() };
/// let cfg = SegmentationCfg::labeled(&[("table|shelf", "furniture")]);
/// let all = Segmentation::new([thing(1, "table"), thing(2, "shelf"), thing(3, "cube")], &cfg)?;
/// assert_eq!(all.segments(SegmentLevel::Semantic)[0].name, "furniture");
/// assert_eq!(all.segment_of(SegmentLevel::Semantic, 2), 1);
/// # Ok::<(), kinetoscope_sensors::SensorError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SegmentationCfg {
    /// Patterns and classes. A pattern is a regular expression. It must match the whole name of an object (`arm`, which
    /// means all its links), `object/link`, or the link alone. No two patterns may match the same entity. Entities
    /// without a match keep their own class.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub labels: Vec<(String, String)>,
}

impl SegmentationCfg {
    /// Creates a configuration from pairs of pattern and class.
    pub fn labeled(labels: &[(&str, &str)]) -> Self {
        Self { labels: labels.iter().map(|(pattern, class)| ((*pattern).into(), (*class).into())).collect() }
    }
}

/// One segment of a level.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Segment id in segmented images, never 0.
    pub id: i32,
    /// Name of the object, `object/link`, or the class. Two segments have the same name if two entities have; ids are
    /// unique.
    pub name: String,
    /// Class; for an object whose links have several classes, the class of the first link.
    pub class: String,
    /// Mask ids of the segment, in ascending order.
    pub mask_ids: Vec<i32>,
}

/// Mapping from mask ids to segments, with names and classes. Converts images of the mask channel to segmented images.
#[derive(Clone, Debug)]
pub struct Segmentation {
    levels: [SegmentTable; 3],
}

/// Segments of one level.
#[derive(Clone, Debug, Default)]
pub(super) struct SegmentTable {
    segments: Vec<Segment>,
    /// Pairs of mask id and segment id, sorted by mask id.
    segment_of_mask: Vec<(i32, i32)>,
}

impl SegmentTable {
    /// Returns the segment id of a mask id: 0 for 0, [`Segmentation::UNKNOWN`] for unknown mask ids.
    pub(super) fn segment_of(&self, mask_id: i32) -> i32 {
        if mask_id == 0 {
            return 0;
        }
        let at = self.segment_of_mask.binary_search_by_key(&mask_id, |(mask, _)| *mask);
        at.map_or(Segmentation::UNKNOWN, |at| self.segment_of_mask[at].1)
    }
}

impl Segmentation {
    /// Segment id of unknown mask ids, such as those of entities added later.
    pub const UNKNOWN: i32 = -1;

    /// Creates the segments of the given entities.
    ///
    /// # Errors
    ///
    /// [`CameraError::MaskId`] for a mask id that is 0, negative or given twice, or whose class has no name;
    /// [`SensorError::UnknownName`] for a pattern that matches nothing, with the nearest names;
    /// [`SensorError::Pattern`] for a pattern that is not a regular expression, and for an entity that two patterns
    /// match.
    pub fn new(things: impl IntoIterator<Item = SegmentedEntity>, cfg: &SegmentationCfg) -> Result<Self, SensorError> {
        let mut things: Vec<SegmentedEntity> = things.into_iter().collect();
        things.sort_by_key(|thing| thing.id);
        let wrong = |id, problem| Err(CameraError::MaskId { id, problem }.into());
        if let Some(nothing) = things.iter().find(|thing| thing.id == 0) {
            return wrong(nothing.id, "is reserved for the background");
        }
        if let Some(negative) = things.iter().find(|thing| thing.id < 0) {
            return wrong(negative.id, "is negative; ids count from 1, and -1 stands for unknown ids");
        }
        if let Some(pair) = things.windows(2).find(|pair| pair[0].id == pair[1].id) {
            return wrong(pair[0].id, "is given twice");
        }
        assign_classes(&mut things, &cfg.labels)?;
        if let Some(nameless) = things.iter().find(|thing| thing.class.is_empty()) {
            return wrong(nameless.id, "has a class without a name");
        }
        // Links of one object are one instance. Entities without links stay separate whatever their names: a geom of
        // the world may have the name of a robot.
        let alone = |thing: &SegmentedEntity| thing.link.is_none().then_some(thing.id);
        let instances = group_segments(&things, |thing| (thing.object.clone(), alone(thing)), false);
        let links = group_segments(&things, |thing| (thing.name(), Some(thing.id)), false);
        let classes = group_segments(&things, |thing| (thing.class.clone(), None), true);
        Ok(Self { levels: [instances, links, classes] })
    }

    /// Returns all segments of a level, ordered by the smallest mask id of each.
    pub fn segments(&self, level: SegmentLevel) -> &[Segment] {
        &self.level(level).segments
    }

    /// Returns the segment id of a mask id: 0 for 0 (nothing was hit), [`UNKNOWN`](Self::UNKNOWN) for unknown mask ids.
    pub fn segment_of(&self, level: SegmentLevel, mask_id: i32) -> i32 {
        self.level(level).segment_of(mask_id)
    }

    pub(super) fn level(&self, level: SegmentLevel) -> &SegmentTable {
        match level {
            SegmentLevel::Instance => &self.levels[0],
            SegmentLevel::Link => &self.levels[1],
            SegmentLevel::Semantic => &self.levels[2],
        }
    }
}

/// Assigns classes to the entities that labels match. A pattern that matches nothing, and an entity that two match, are
/// errors.
fn assign_classes(things: &mut [SegmentedEntity], labels: &[(String, String)]) -> Result<(), SensorError> {
    let names: Vec<String> = things.iter().map(SegmentedEntity::name).collect();
    let objects: Vec<String> = things.iter().map(|thing| thing.object.clone()).collect();
    let mut taken_by: Vec<Option<&str>> = vec![None; things.len()];
    for (pattern, class) in labels {
        let of_objects = matching(pattern, &objects, "object");
        let of_links = matching(pattern, &names, "object or link");
        let mut found = match (of_objects, of_links) {
            (Ok(objects), Ok(links)) => [objects, links].concat(),
            (Ok(found), Err(_)) | (Err(_), Ok(found)) => found,
            (Err(_), Err(SensorError::UnknownName { what, name, .. })) => {
                let mut known: Vec<&str> = objects.iter().chain(&names).map(String::as_str).collect();
                known.extend(things.iter().filter_map(|thing| thing.link.as_deref()));
                known.sort_unstable();
                known.dedup();
                let candidates = closest_names(&name, known).into_iter().map(str::to_owned).collect();
                return Err(SensorError::UnknownName { what, name, candidates });
            }
            (Err(_), Err(wrong)) => return Err(wrong),
        };
        found.sort_unstable();
        found.dedup();
        for index in found {
            if let Some(first) = taken_by[index].replace(pattern) {
                let (what, name) = ("object or link", names[index].clone());
                let twice = PatternError::MatchedTwice { what, name, first: first.into(), second: pattern.clone() };
                return Err(SensorError::Pattern(twice.to_string()));
            }
            things[index].class.clone_from(class);
        }
    }
    Ok(())
}

/// Groups entities with the same key into segments. The key begins with the name. The segment id is the first mask id,
/// or, if `numbered`, an index from 1 on.
fn group_segments(
    things: &[SegmentedEntity],
    key: impl Fn(&SegmentedEntity) -> (String, Option<i32>),
    numbered: bool,
) -> SegmentTable {
    let mut level = SegmentTable::default();
    let mut known: HashMap<(String, Option<i32>), usize> = HashMap::new();
    for thing in things {
        let key = key(thing);
        let name = key.0.clone();
        let segments = &mut level.segments;
        let index = *known.entry(key).or_insert(segments.len());
        if index == segments.len() {
            let id = if numbered { index as i32 + 1 } else { thing.id };
            segments.push(Segment { id, name, class: thing.class.clone(), mask_ids: Vec::new() });
        }
        segments[index].mask_ids.push(thing.id);
        level.segment_of_mask.push((thing.id, segments[index].id));
    }
    level
}

#[cfg(test)]
mod tests {
    use super::*;

    fn thing(id: i32, object: &str, link: Option<&str>, class: &str) -> SegmentedEntity {
        SegmentedEntity { id, object: object.into(), link: link.map(Into::into), class: class.into() }
    }

    fn things() -> Vec<SegmentedEntity> {
        vec![
            thing(1, "ground", None, "ground"),
            thing(6, "shelf", None, "object"),
            thing(2, "arm", Some("base"), "robot"),
            thing(3, "arm", Some("finger_l"), "robot"),
            thing(4, "arm", Some("finger_r"), "robot"),
            thing(5, "table", None, "object"),
            thing(7, "cube", None, "toy"),
        ]
    }

    /// Ids, names and mask ids of the classes.
    fn classes(labels: &[(&str, &str)]) -> String {
        let all = Segmentation::new(things(), &SegmentationCfg::labeled(labels)).unwrap();
        let of = |s: &Segment| format!("{} {} {:?}", s.id, s.name, s.mask_ids);
        all.segments(SegmentLevel::Semantic).iter().map(of).collect::<Vec<_>>().join(", ")
    }

    #[test]
    fn levels() {
        let all = Segmentation::new(things(), &SegmentationCfg::default()).unwrap();
        let more = things().into_iter().chain([thing(8, "lamp", None, "light")]);
        let more = Segmentation::new(more, &SegmentationCfg::default()).unwrap();
        for (level, names, segments) in [
            (SegmentLevel::Instance, "1 ground, 2 arm, 5 table, 6 shelf, 7 cube", [0, 1, 2, 2, 6, 7, -1, -1]),
            (SegmentLevel::Link, "1 ground, 2 arm/base, 3 arm/finger_l, 4 arm/finger_r", [0, 1, 2, 4, 6, 7, -1, -1]),
            (SegmentLevel::Semantic, "1 ground, 2 robot, 3 object, 4 toy", [0, 1, 2, 2, 3, 4, -1, -1]),
        ] {
            let of = |segment: &Segment| format!("{} {}", segment.id, segment.name);
            let found: Vec<String> = all.segments(level).iter().map(of).collect();
            assert_eq!(found[..names.split(", ").count()].join(", "), names);
            assert_eq!([0, 1, 2, 4, 6, 7, 8, -5].map(|id| all.segment_of(level, id)), segments);
            assert!(level == SegmentLevel::Link || found.len() == names.split(", ").count());
            // An object that is added later changes no id.
            assert_eq!(more.segments(level)[..found.len()], *all.segments(level), "{level:?}");
        }
    }

    #[test]
    fn patterns() {
        let found = classes(&[("table|shelf", "furniture"), ("finger.*", "hand")]);
        assert_eq!(found, "1 ground [1], 2 robot [2], 3 hand [3, 4], 4 furniture [5, 6], 5 toy [7]");
        // A pattern for an object matches all its links. A link may be given by its full name. Existing class names may
        // be reused.
        assert_eq!(classes(&[("arm|cube", "toy"), ("ground", "object")]), "1 object [1, 5, 6], 2 toy [2, 3, 4, 7]");
        assert!(classes(&[("arm/finger_l", "left")]).contains(", 3 left [3],"));
    }

    #[test]
    fn mistakes() {
        let error = |labels: &[(&str, &str)]| {
            Segmentation::new(things(), &SegmentationCfg::labeled(labels)).unwrap_err().to_string()
        };
        let unknown = error(&[("tabel", "furniture")]);
        assert!(unknown.starts_with("unknown object or link \"tabel\"; known names: \"table\""), "{unknown}");
        assert!(error(&[("fingerl", "hand")]).contains("known names: \"finger_l\""));
        let both = error(&[("arm", "robot"), ("finger_.", "hand")]);
        assert!(both.contains("\"arm/finger_l\" is matched by both \"arm\" and \"finger_.\""), "{both}");
        assert!(error(&[("(", "x")]).contains("not a regular expression"));
        assert!(error(&[("(?!a)b", "x")]).contains("look-around"));
        assert_eq!(error(&[("table", "")]), "mask id 5 has a class without a name");
        let twice = vec![thing(3, "a", None, "b"), thing(3, "c", None, "b")];
        for (things, text) in [
            (vec![thing(0, "a", None, "b")], "mask id 0 is reserved for the background"),
            (
                vec![thing(-1, "a", None, "b")],
                "mask id -1 is negative; ids count from 1, and -1 stands for unknown ids",
            ),
            (vec![thing(4, "a", None, "")], "mask id 4 has a class without a name"),
            (twice, "mask id 3 is given twice"),
        ] {
            assert_eq!(Segmentation::new(things, &SegmentationCfg::default()).unwrap_err().to_string(), text);
        }
    }

    #[test]
    fn equal_names() {
        let twins = [
            thing(1, "arm", None, "world"),
            thing(2, "arm", Some("base"), "robot"),
            thing(3, "arm", Some("tip"), "robot"),
            thing(4, "arm/tip", None, "object"),
            thing(5, "arm", None, "world"),
        ];
        let all = Segmentation::new(twins, &SegmentationCfg::default()).unwrap();
        let of = |level| [1, 2, 3, 4, 5].map(|id| all.segment_of(level, id));
        assert_eq!(of(SegmentLevel::Instance), [1, 2, 2, 4, 5]);
        assert_eq!(of(SegmentLevel::Link), [1, 2, 3, 4, 5]);
        assert_eq!(of(SegmentLevel::Semantic), [1, 2, 2, 3, 1]);
    }
}
