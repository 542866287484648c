/** The page "Air table". */
