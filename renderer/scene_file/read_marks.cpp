#include <fmt/format.h>

#include "renderer/scene/mounting.h"
#include "renderer/scene_file/scene_parts.h"

namespace narpa {

namespace {

std::vector<std::string_view> tag_dictionaries() {
    std::vector<std::string_view> names;
    for (const TagDictionary& d : kTagDictionaries) names.push_back(d.name);
    return names;
}

constexpr Range kMarkLength{.low = 0, .high = 1e12, .low_open = true};
constexpr TableKey kMarkRows[]{
    kNameRow,
    {"kind", rows::kind(), "one of \"lamp\", \"reflector\", \"tag\""},
    {"position_m", rows::vec3(), "[x, y, z], the mark's optical centre"},
};
constexpr TableKey kMarkDiscRows[]{
    {"radius_m", rows::number(kMarkLength), "a number > 0"},
    {"normal", rows::direction()},
};
constexpr TableKey kMarkTagRows[]{
    {"dictionary", rows::choice(tag_dictionaries), "the name of a dictionary, \"4X4_50\" or \"APRILTAG_36h11\""},
    {"id", rows::integer(0, 65535), "the tag's number in its dictionary"},
    {"side_m", rows::number(kMarkLength), "the side of its black square"},
    {"attitude_wxyz", rows::attitude(), "[w, x, y, z], from the tag's axes to the body's"},
};

/// In the order of Mark::Kind.
std::vector<TableKind> mark_kinds() {
    constexpr auto& names = Mark::kKindNames;
    return {{names[0], kMarkDiscRows}, {names[1], kMarkDiscRows}, {names[2], kMarkTagRows}};
}

/// The least rotation that takes z to this direction.
Quat facing(const Vec3& normal) {
    const Vec3 z{0, 0, 1};
    if (normal.z < -1 + 1e-12) return {0, 1, 0, 0};
    const Vec3 axis = cross(z, normal);
    return normalized(Quat{1 + normal.z, axis.x, axis.y, axis.z});
}

void read_tag(TableReader& table, Mark& mark) {
    if (const auto index = table.word("dictionary")) mark.dictionary = static_cast<int>(*index);
    const TagDictionary& dictionary = kTagDictionaries[static_cast<std::size_t>(mark.dictionary)];
    if (const auto id = table.integer("id")) mark.id = static_cast<int>(*id);
    if (mark.id >= dictionary.tags)
        table.fail("id",
                   fmt::format("{} is not in {}, expected 0 to {}", mark.id, dictionary.name, dictionary.tags - 1));
    table.read("side_m", mark.side_m);
    table.read("attitude_wxyz", mark.T_body_mark.q);
}

Mark read_mark(TableReader& table, TakenNames& names) {
    Mark mark;
    mark.name = read_name(table, names);
    table.read("position_m", mark.T_body_mark.t);
    const auto kind = table.kind();
    if (!kind) return mark;  // its keys depend on the kind
    mark.kind = static_cast<Mark::Kind>(*kind);
    if (mark.kind == Mark::Kind::tag) {
        read_tag(table, mark);
    } else {
        table.read("radius_m", mark.radius_m);
        const auto normal = table.direction("normal");
        mark.is_spherical = !table.has("normal");
        if (normal) mark.T_body_mark.q = facing(*normal);
    }
    table.finish();
    return mark;
}

/// Two tags of one number cannot be told apart.
void check_tag(TableReader& table, const Mark& mark, const std::vector<Mark>& others) {
    for (const Mark& other : others)
        if (mark.kind == Mark::Kind::tag && other.kind == Mark::Kind::tag && mark.dictionary == other.dictionary &&
            mark.id == other.id)
            table.fail(
                "id", fmt::format("{} is the number of mark \"{}\", expected one of its own", mark.id, other.name));
}

}  // namespace

constinit const TableKeys kMarkKeys{.rows = kMarkRows, .kinds = mark_kinds};

void read_marks(TableReader& body_table, Body& body) {
    TakenNames names;
    for (TableReader& table : body_table.tables("mark")) {
        const Mark mark = read_mark(table, names);
        check_tag(table, mark, body.marks);
        body.marks.push_back(mark);
    }
}

}  // namespace narpa
