#include "report/report_script.hpp"

namespace clsp {
namespace {

const char *const kLicence = R"TEXT(/*
Vega and the D3 modules within it draw the figures of this page.

Vega: Copyright (c) 2015-2021, University of Washington Interactive Data Lab. All rights reserved.
Its expression parser is based on Esprima: Copyright 2011-2013 Ariya Hidayat and others.
D3: Copyright 2010-2021 Mike Bostock.

Redistribution and use in source and binary forms, with or without modification, are permitted provided that the
following conditions are met:
1. Redistributions of source code must retain the above copyright notice, this list of conditions and the following
   disclaimer.
2. Redistributions in binary form must reproduce the above copyright notice, this list of conditions and the
   following disclaimer in the documentation and/or other materials provided with the distribution.
3. Neither the name of the copyright holder nor the names of its contributors may be used to endorse or promote
   products derived from this software without specific prior written permission.

THIS SOFTWARE IS PROVIDED BY THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS" AND ANY EXPRESS OR IMPLIED WARRANTIES,
INCLUDING, BUT NOT LIMITED TO, THE IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE
DISCLAIMED. IN NO EVENT SHALL THE COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL,
SPECIAL, EXEMPLARY, OR CONSEQUENTIAL DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR
SERVICES; LOSS OF USE, DATA, OR PROFITS; OR BUSINESS INTERRUPTION) HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY,
WHETHER IN CONTRACT, STRICT LIABILITY, OR TORT (INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE
OF THIS SOFTWARE, EVEN IF ADVISED OF THE POSSIBILITY OF SUCH DAMAGE.
*/
)TEXT";

// Vega's modules are CommonJS modules that name each other; one of them names vega-selection by its later name.
// Expressions are interpreted, not compiled, so that the page's policy can forbid the evaluation of text.
const char *const kLoader = R"TEXT((function () {
"use strict";
var bodies = {}, loaded = {};
function require(name) {
    if (name === "vega-selections") name = "vega-selection";
    if (!loaded[name]) {
        var module = { exports: {} };
        loaded[name] = module.exports;
        bodies[name](module.exports, require, module);
    }
    return loaded[name];
}
)TEXT";

const char *const kStart = R"TEXT(
Object.assign(require("vega-dataflow").transforms, require("vega-transforms"), require("vega-view-transforms"),
              require("vega-encode"));
var parse = require("vega-parser").parse, View = require("vega-view").View;
var interpreter = require("vega-interpreter").expressionInterpreter;
document.querySelectorAll("script.vega-specification").forEach(function (element) {
    var place = document.getElementById(element.getAttribute("data-figure"));
    function failed(error) {
        place.textContent = "This figure could not be drawn: " + error.message;
        place.className = "failed";
    }
    try {
        var specification = JSON.parse(element.textContent);
        var options = { expr: interpreter, renderer: "svg", container: place, hover: true };
        new View(parse(specification, null, { ast: true }), options).runAsync().catch(failed);
    } catch (error) {
        failed(error);
    }
});
// Paper cannot be clicked.
window.addEventListener("beforeprint", function () {
    document.querySelectorAll("details").forEach(function (element) { element.open = true; });
});
})();
)TEXT";

} // namespace

std::string report_script() {
    std::string script = kLicence;
    script += kLoader;
    for (std::size_t i = 0; i < kVegaModuleCount; ++i) {
        script += "bodies[\"";
        script += kVegaModules[i].name;
        script += "\"] = function (exports, require, module) {\n";
        script += kVegaModules[i].text;
        script += "\n};\n";
    }
    return script + kStart;
}

} // namespace clsp
